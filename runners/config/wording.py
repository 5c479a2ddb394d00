"""How several rooms write the same thing: a number of things, a table or a comment in markup."""

from __future__ import annotations

import re
from collections.abc import Iterable


def counted(number: int, noun: str) -> str:
    """ "1 world", "2,000 worlds"."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def markdown_table(lines: Iterable[Iterable[str]]) -> str:
    """The cells of each line as a Markdown table: the header, the rule, then the rows."""
    escaped = ([cell.replace("|", r"\|") for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in escaped)


def without_markup(text: str, marks: str) -> str:
    """A comment with its own backticks, and with a backslash before every other one of these marks."""
    parts = re.split(r"(`[^`]*`)", text)
    mark = re.compile(f"([{re.escape(marks)}])")
    return "".join(part if part.startswith("`") else mark.sub(r"\\\1", part) for part in parts)
