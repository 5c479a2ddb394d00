"""Make text fit to be shown: escaped for every output format, without passwords, as counted nouns and as tables.

Text of a run may come from anyone, so it is displayed and never interpreted.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

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
_GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "varepsilon", "ζ": "zeta", "η": "eta", "θ": "theta",
    "ι": "iota", "κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "π": "pi", "ρ": "rho", "σ": "sigma",
    "ς": "varsigma", "τ": "tau", "υ": "upsilon", "φ": "varphi", "χ": "chi", "ψ": "psi", "ω": "omega",
    "Γ": "Gamma", "Δ": "Delta", "Θ": "Theta", "Λ": "Lambda", "Ξ": "Xi", "Π": "Pi", "Σ": "Sigma", "Φ": "Phi",
    "Ψ": "Psi", "Ω": "Omega",
}  # fmt: skip
_SIGNS = {
    "±": r"\pm", "\u2212": "-", "\u00d7": r"\times", "≤": r"\le", "≥": r"\ge", "≠": r"\ne", "≈": r"\approx",
    "∞": r"\infty", "→": r"\to", "√": r"\surd", "∈": r"\in", "∂": r"\partial", "∑": r"\sum", "⋅": r"\cdot",
}  # fmt: skip
_LATEX = {
    "|Δω|": r"$|\Delta\omega|$", "\u2013": "--", "\\": r"\textbackslash{}", '"': r"\symbol{34}",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "`": r"\textasciigrave{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}",
    **{letter: f"\\{letter}" for letter in "_%&#{}$"},
    **{letter: rf"$\{name}$" for letter, name in _GREEK.items()},
    **{sign: f"${command}$" for sign, command in _SIGNS.items()},
}  # fmt: skip
_HYPHEN = "-{}"  # before another one, with which it would become a dash
_IN_LATEX = re.compile("|".join([*map(re.escape, _LATEX), "-(?=-)"]))
HIDDEN = "***"
# A password may itself hold `@`, `:` or `/`, so all text up to the last `@` counts as one.
_ACCOUNT = re.compile(r"(\b[a-z][\w+.-]*:/+[^\s:/]*:)(?!\*\*\*@).+@", re.IGNORECASE)
_ACCOUNT_ALONE = re.compile(r"^([^\s:/]*:).+@")  # of a URL without its scheme
_TOKEN = re.compile(r"(\bhttps?:/+)[^\s/@:]+@", re.IGNORECASE)  # a user without a password is an access token
_PLAIN = re.compile(r"[\w.~*-]", re.ASCII)  # what a password may hold unescaped
_QUERY = re.compile(r"([?&;]\w*(?:pass|pwd|secret|token|api_?key)\w*=)[^\s)]+", re.IGNORECASE)


def visible(text: str, keep: str = "") -> str:
    """Escape text for a terminal: control codes and marks of text direction are shown as \\x1b or \\u202e.

    keep: characters that stay, such as line breaks.
    """
    return _HIDDEN.sub(lambda match: match[0] if match[0] in keep else _code(match[0]), text)


def html_text(text: str) -> str:
    """Escape text for HTML, between tags or in quotes."""
    return html.escape(visible(text))


def html_address(path: str | Path) -> str:
    """Return the path of a file as a URL, whatever bytes its name has."""
    return quote(str(path).encode("utf-8", "surrogateescape"))


def markdown_text(text: str) -> str:
    """Escape text for Markdown: no tags, code, links, headings, lists or line breaks. A table escapes | itself."""
    plain = _MARKUP.sub(lambda match: "".join(f"&#{ord(letter)};" for letter in match[0]), visible(text))
    return _BLOCK.sub(lambda match: f"&#{ord(match[0])};", plain)


def latex_text(text: str) -> str:
    """Escape text for LaTeX, also for the beginning of a table's line, where \\\\ would take [ or * as its own.

    Greek letters and signs become mathematics, which every engine knows; letters of other scripts stay.
    """
    escaped = _IN_LATEX.sub(lambda match: _LATEX.get(match[0], _HYPHEN), visible(text))
    return f"{{{escaped[0]}}}{escaped[1:]}" if escaped[:1] in ("[", "*") else escaped


def csv_value(value: Any) -> Any:
    """Return a value for CSV. Text that a spreadsheet would read as a formula gets an apostrophe; numbers stay."""
    if not isinstance(value, str | Path):
        return value
    text = str(value)
    visible_text = visible(text)
    formula = text.lstrip()[:1] in _FORMULA or text[:1] in ("\t", "\r", "\n")
    return f"'{visible_text}" if text and formula and not _is_number(text) else visible_text


def plot_text(text: str) -> str:
    """Escape text for a picture, since Matplotlib would read text between dollar signs as mathematics."""
    return visible(text, keep="\n").replace("$", r"\$")


def json_text(text: str) -> str:
    """Return JSON with everything that a terminal would interpret written as \\u001b."""
    return _HIDDEN.sub(lambda match: "".join(f"\\u{unit:04x}" for unit in _utf16(match[0])), text)


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


def masked(url: str) -> str:
    """Return the URL without its password."""
    address, mark, query = url.partition("?")
    if (mark and not _ACCOUNT.search(f"{address}@")) or re.search(r"//[^/:]*:\d*(/[^?]*)?$", address):
        return masked_text(address) + re.sub(rf"{_QUERY.pattern}.*", rf"\1{HIDDEN}", mark + query, flags=re.I)
    masked_url = masked_text(url)
    if masked_url == url and ":/" not in url:
        masked_url = _ACCOUNT_ALONE.sub(rf"\1{HIDDEN}@", url)
    return masked_url


def masked_text(text: str) -> str:
    """Return a text without the passwords of the URLs in it; in doubt it hides too much."""
    if "@" not in text and "=" not in text:
        return text
    text = _ACCOUNT.sub(rf"\1{HIDDEN}@", text)
    return _QUERY.sub(rf"\1{HIDDEN}", _TOKEN.sub(rf"\1{HIDDEN}@", text))


def reveals_password(text: str, url: str) -> bool:
    """Return whether a text about a URL, such as that of a driver, may hold the password or a part of it.

    If characters of the password are not escaped, the driver has split the URL at the wrong place.
    """
    password = _password(url)
    if not password:
        return url != masked(url)
    return bool(fault_of_password(url)) or password in text or unquote(password) in text


def fault_of_password(url: str) -> str:
    """Return what is wrong with the spelling of the password in the URL; empty if nothing is."""
    wrong = sorted(
        {letter for letter in re.sub(r"%[0-9A-Fa-f]{2}", "", _password(url)) if not _PLAIN.match(letter)}
    )
    if not wrong:
        return ""
    escapes = [f"{'a space' if letter == ' ' else letter} as {quote(letter, safe='')}" for letter in wrong]
    return f"the password must be escaped: {', '.join(escapes)}"


def _password(url: str) -> str:
    """Return the password before the last @; empty if there is none."""
    account, _, _ = url.rpartition("@")
    return re.sub(r"^[a-z][\w+.-]*:/+", "", account, flags=re.IGNORECASE).partition(":")[2]


def masked_values(value: Any) -> Any:
    """Return a config of plain values without the passwords of the URLs in it."""
    if isinstance(value, str):
        return masked_text(value)
    if isinstance(value, dict):
        return {key: masked_values(child) for key, child in value.items()}
    return [masked_values(child) for child in value] if isinstance(value, list) else value


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
