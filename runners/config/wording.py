"""Wording that several packages share: counted nouns, and tables and comments in markup."""

from __future__ import annotations

import re
from collections.abc import Iterable


def counted(number: int, noun: str) -> str:
    """Return a counted noun such as "1 world" or "2,000 worlds"."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def markdown_table(lines: Iterable[Iterable[str]]) -> str:
    """Return the cells of each line as a Markdown table: the header, the rule, then the rows."""
    escaped = ([cell.replace("|", r"\|") for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in escaped)


def without_markup(text: str, marks: str) -> str:
    """Escape each of these marks with a backslash, except within backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    mark = re.compile(f"([{re.escape(marks)}])")
    return "".join(part if part.startswith("`") else mark.sub(r"\\\1", part) for part in parts)
