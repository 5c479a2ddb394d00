"""Escape text of a run from anyone for every output format, so that it is displayed and never interpreted."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

# Control codes, marks that reorder or hide text, and bytes of file names that are not UTF-8.
_HIDDEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f]"
)
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")  # also full-width
_MARKUP = re.compile(
    r"<(?=[A-Za-z/!?])|&(?=#?\w+;)|`|(?<=\])\(|!(?=\[)"
)  # tags, entities, code, links, pictures
_BLOCK = re.compile(r"^[#>*+-](?=[#\s])")  # at the beginning of a heading, a quotation or a list
_LATEX = {
    "|Δω|": r"$|\Delta\omega|$", "±": r"$\pm$", "\u2013": "--", "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "`": r"\textasciigrave{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}",
    **{letter: f"\\{letter}" for letter in "_%&#{}$"},
}  # fmt: skip
_IN_LATEX = re.compile("|".join(map(re.escape, _LATEX)))


def visible(text: str, keep: str = "") -> str:
    """Escape text for a terminal: control codes and marks of text direction are shown as \\x1b or \\u202e.

    keep: characters that stay, such as line breaks.
    """
    return _HIDDEN.sub(lambda found: found[0] if found[0] in keep else _code(found[0]), text)


def html_text(text: str) -> str:
    """Escape text for HTML, between tags or in quotes."""
    return html.escape(visible(text))


def html_address(path: str | Path) -> str:
    """Return the path of a file as a URL, whatever bytes its name has."""
    return quote(str(path).encode("utf-8", "surrogateescape"))


def markdown_text(text: str) -> str:
    """Escape text for Markdown: no tags, code, links, headings, lists or line breaks. A table escapes | itself."""
    plain = _MARKUP.sub(lambda found: "".join(f"&#{ord(letter)};" for letter in found[0]), visible(text))
    return _BLOCK.sub(lambda found: f"&#{ord(found[0])};", plain)


def latex_text(text: str) -> str:
    """Escape text for LaTeX, also for the beginning of a table's line, where \\\\ would take [ or * as its own."""
    escaped = _IN_LATEX.sub(lambda found: _LATEX[found[0]], visible(text))
    return f"{{{escaped[0]}}}{escaped[1:]}" if escaped[:1] in ("[", "*") else escaped


def csv_value(value: Any) -> Any:
    """Return a value for CSV. Text that a spreadsheet would read as a formula gets an apostrophe; numbers stay."""
    if not isinstance(value, str | Path):
        return value
    text = str(value)
    shown = visible(text)
    formula = text.lstrip()[:1] in _FORMULA or text[:1] in ("\t", "\r", "\n")
    return f"'{shown}" if text and formula and not _is_number(text) else shown


def plot_text(text: str) -> str:
    """Escape text for a picture, since Matplotlib would read text between dollar signs as mathematics."""
    return visible(text, keep="\n").replace("$", r"\$")


def json_text(text: str) -> str:
    """Return JSON with everything that a terminal would interpret written as \\u001b."""
    return _HIDDEN.sub(lambda found: "".join(f"\\u{unit:04x}" for unit in _utf16(found[0])), text)


def _code(letter: str) -> str:
    number = ord(letter)
    return (
        f"\\x{number:02x}"
        if number < 0x100
        else f"\\u{number:04x}"
        if number < 0x10000
        else f"\\U{number:08x}"
    )


def _utf16(letter: str) -> list[int]:
    data = letter.encode("utf-16-be", "surrogatepass")
    return [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
