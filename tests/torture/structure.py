"""A second way to damage files, unlike `mutations`: by what they are, how they are encoded, and how they are built."""

from __future__ import annotations

import gzip
import itertools
import json
import os
import re
import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

Rng = np.random.Generator

TERABYTE = 2**40
NUMBERS = (
    "1e308", "-1e308", "1e-320", "-0.0", "NaN", ".nan", "-.inf", "Infinity", "1e999", "9" * 400, "9" * 5000, "0x1F",
    "1_000", "0o17", "१२", "1,5", "60:30", "0b1", "-1", "0", "2147483648", "18446744073709551616", "1e5", "+1.", "true",
)  # fmt: skip
WORDS = (
    '"\\ud800"', '"\\u0000"', '"\u202eabc"', '"\u2028"', "null", "[]", "{}", '""', "~", "[[[]]]", '{"a": {"a": 1}}',
    '"../../../etc/passwd"', '"~root/x"', '"/dev/zero"', '"' + "é" * 3000 + '"', '"${oc.env:HOME}"', "2020-01-01",
)  # fmt: skip
YAML_WORDS = (
    "!!python/object/apply:os.system [id]", "!!binary aGk=", "!!set {a, b}", "!!str 1", "!mine 3", "&a [*a]",
    "&b {b: *b}", "{<<: &c {x: 1}}", "*nowhere", "|\n    text", "!!omap [a: 1]", "!!float 'x'", "? [1]", "%",
)  # fmt: skip
_NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")


def spoil(rng: Rng, folder: Path) -> None:
    """Damage one file of a folder in one way, or in two."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = files[rng.integers(len(files))]
    if rng.random() < 0.15:
        return KINDS[rng.integers(len(KINDS))](path)
    ways = (*OF_SUFFIX.get(path.suffix, BLOCKS) * 2, *ENCODINGS)
    for _ in range(rng.integers(1, 3)):
        path.write_bytes(ways[rng.integers(len(ways))](rng, path.read_bytes()))
    return None


def _replaced(make: Callable[[Path], object]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.unlink()
        make(path)

    return change


def _listen(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(os.path.relpath(path))  # the name of a socket is short


KINDS: tuple[Callable[[Path], None], ...] = (
    _replaced(os.mkfifo),
    _replaced(os.mkdir),
    _replaced(_listen),
    _replaced(lambda path: path.symlink_to(path.name)),
    _replaced(lambda path: path.symlink_to("/dev/zero")),
    _replaced(lambda path: path.symlink_to(path.with_name("nowhere"))),
    lambda path: os.truncate(path, TERABYTE),
    _replaced(lambda path: (path.touch(), os.truncate(path, TERABYTE))),
    _replaced(lambda path: path.touch()),
)

ENCODINGS: tuple[Callable[[Rng, bytes], bytes], ...] = (
    lambda rng, data: data.decode("latin-1").encode("utf-16"),
    lambda rng, data: b"\xef\xbb\xbf" + data,
    lambda rng, data: data.replace(b"\n", b"\r\n"),
    lambda rng, data: data.replace(b"\n", b"\r"),
    lambda rng, data: gzip.compress(data),
    lambda rng, data: data + data,
    lambda rng, data: data * 30,
    lambda rng, data: data + bytes(int(rng.integers(1, 5000))),
    lambda rng, data: bytes(len(data)),
    lambda rng, data: data[::-1],
    lambda rng, data: b"".join(rng.permutation(np.array(data.splitlines(keepends=True) or [b""], object))),
)


def _chunks(rng: Rng, data: bytes) -> list[bytes]:
    """The data cut at a few places, often at a power of two."""
    cuts = np.sort(rng.integers(len(data) + 1, size=4) & ~(int(rng.choice([0, 3, 63, 4095]))))
    ends = [0, *cuts.tolist(), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(ends)]


def _dropped(rng: Rng, data: bytes) -> bytes:
    parts = _chunks(rng, data)
    del parts[rng.integers(len(parts))]
    return b"".join(parts)


def _repeated(rng: Rng, data: bytes) -> bytes:
    parts = _chunks(rng, data)
    parts[rng.integers(len(parts))] *= int(rng.integers(2, 20))
    return b"".join(parts)


def _number_in_binary(rng: Rng, data: bytes) -> bytes:
    """A float or an integer somewhere becomes a hostile one."""
    kind = ("<f4", "<f8", "<i4", "<u8", ">u4")[rng.integers(5)]
    values = (np.nan, np.inf, -np.inf, 1e300) if "f" in kind else (0, 1, 2**31 - 1, 2**16)
    with np.errstate(over="ignore"):
        raw = np.array(values[rng.integers(4)]).astype(kind).tobytes()
    at = int(rng.integers(max(len(data) - len(raw), 0) + 1)) & ~3
    return data[:at] + raw + data[at + len(raw) :]


BLOCKS: tuple[Callable[[Rng, bytes], bytes], ...] = (
    lambda rng, data: b"".join(rng.permutation(np.array(_chunks(rng, data), object))),
    _dropped,
    _repeated,
    _number_in_binary,
    _number_in_binary,
)


def _number(rng: Rng, data: bytes) -> bytes:
    """A number of a text becomes another, or all do by a factor, as with other units."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return _dropped(rng, data)
    if rng.random() < 0.2:
        factor = float(rng.choice([1e-3, 1e3, 1e300, -1.0, 0.0]))
        return _NUMBER.sub(lambda match: repr(float(match[0]) * factor).encode(), data)
    match = found[rng.integers(len(found))]
    return data[: match.start()] + NUMBERS[rng.integers(len(NUMBERS))].encode() + data[match.end() :]


def _columns_swapped(rng: Rng, data: bytes) -> bytes:
    order, lines = rng.permutation(4), [line.split() for line in data.splitlines()]
    swapped = ([words[k] for k in order] + words[4:] if len(words) > 3 else words for words in lines)
    return b"\n".join(b" ".join(words) for words in swapped)


def _long_line(rng: Rng, data: bytes) -> bytes:
    return data + b"1 " * int(rng.integers(1, 1_000_000)) + b"\n"


def _node(rng: Rng, data: bytes, words: tuple[str, ...], parsed: Callable[[bytes], object]) -> bytes:
    """A value of YAML or JSON becomes another, stands under the key of another one, or its key is there twice."""
    try:
        tree = parsed(data)
        spots = [(part, key) for part in _collections(tree) for key in _keys(part)]
        (parent, key), (other, at) = (spots[rng.integers(len(spots))] for _ in range(2))
        how = rng.integers(5)
        if how == 0:
            parent[key], other[at] = other[at], parent[key]
            return json.dumps(tree, default=str).encode()
        word = words[rng.integers(len(words))]
        if how == 1:
            depth = int(rng.choice([50, 500, 20_000, 200_000]))
            word = "[" * depth + "]" * depth * int(rng.integers(2))
        parent[key] = "HERE"
        text = json.dumps(tree, default=str)
    except Exception:  # damaged before, or a value would contain itself
        return _number(rng, data)
    if how == 2 and isinstance(parent, dict):
        word = f"{word}, {json.dumps(str(key))}: 1"
    return text.replace('"HERE"', word, 1).encode("utf-8", "replace")


def _keys(part: dict | list) -> list:
    return list(part if isinstance(part, dict) else range(len(part)))


def _collections(tree: object) -> list:
    if not isinstance(tree, dict | list):
        return []
    parts = tree.values() if isinstance(tree, dict) else tree
    return [tree, *(inner for part in parts for inner in _collections(part))]


def _yaml(rng: Rng, data: bytes) -> bytes:
    return _node(rng, data, NUMBERS + WORDS + YAML_WORDS, yaml.safe_load)


def _json(rng: Rng, data: bytes) -> bytes:
    """One line of JSON, or the whole file."""
    lines = data.splitlines(keepends=True) or [b""]
    at = int(rng.integers(len(lines))) if lines[0].endswith(b"}\n") or lines[0].endswith(b"]\n") else None
    new = _node(rng, data if at is None else lines[at], NUMBERS + WORDS, json.loads)
    return new if at is None else b"".join([*lines[:at], new, b"\n", *lines[at + 1 :]])


TEXT = (_number, _number, _columns_swapped, _long_line, _dropped, _repeated)
OF_SUFFIX: dict[str, tuple[Callable[[Rng, bytes], bytes], ...]] = {
    ".yaml": (_yaml, _yaml, _yaml, _number),
    **dict.fromkeys((".json", ".jsonl", ".journal"), (_json, _json, _number)),
    **dict.fromkeys((".txt", ".log", ".world"), TEXT),
}
