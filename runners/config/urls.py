"""Mask the passwords in URLs of storages and servers before they are shown."""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import quote, unquote

HIDDEN = "***"
# A password may itself hold `@`, `:` or `/`, so all text up to the last `@` counts as one.
_ACCOUNT = re.compile(r"(\b[a-z][\w+.-]*:/+[^\s:/]*:)(?!\*\*\*@).+@", re.IGNORECASE)
_ACCOUNT_ALONE = re.compile(r"^([^\s:/]*:).+@")  # of a URL without its scheme
_TOKEN = re.compile(r"(\bhttps?:/+)[^\s/@:]+@", re.IGNORECASE)  # a user without a password is an access token
_PLAIN = re.compile(r"[\w.~*-]", re.ASCII)  # what a password may hold unescaped
_QUERY = re.compile(r"([?&;]\w*(?:pass|pwd|secret|token|api_?key)\w*=)[^\s)]+", re.IGNORECASE)


def masked(url: str) -> str:
    """Return the URL without its password."""
    place, mark, query = url.partition("?")
    if (mark and not _ACCOUNT.search(f"{place}@")) or re.search(r"//[^/:]*:\d*(/[^?]*)?$", place):
        return masked_text(place) + re.sub(rf"{_QUERY.pattern}.*", rf"\1{HIDDEN}", mark + query, flags=re.I)
    shown = masked_text(url)
    if shown == url and ":/" not in url:
        shown = _ACCOUNT_ALONE.sub(rf"\1{HIDDEN}@", url)
    return shown


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
        {each for each in re.sub(r"%[0-9A-Fa-f]{2}", "", _password(url)) if not _PLAIN.match(each)}
    )
    if not wrong:
        return ""
    escapes = [f"{'a space' if each == ' ' else each} as {quote(each, safe='')}" for each in wrong]
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
