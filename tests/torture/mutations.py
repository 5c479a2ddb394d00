"""Damage to files: to bytes, to values of YAML and JSON, to the columns of Parquet files, to names of keys."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

Rng = np.random.Generator

NUMBERS = (
    0,
    -1,
    1,
    2**31,
    -(2**63),
    2**64,
    10**400,
    1e308,
    -1e308,
    5e-324,
    float("nan"),
    float("inf"),
    -0.0,
    0.5,
)
TEXTS = (
    "", " ", "x", "nan", "1e999", "../../etc/passwd", "/dev/zero", "a\x00b", "ünï ∞ 机器人", "line\nbreak", "x" * 5000,
    "${oc.env:HOME}", "${nowhere}", "<script>alert(1)</script>", "\ud800", "%s%n", "[1,", "{a: b", "'", "os.system",
)  # fmt: skip
OTHERS = (None, True, False, [], {}, [[]], [None], {"": None}, {"a": {"b": {"c": 1}}}, [1, "a", None])


def spoil(rng: Rng, folder: Path) -> None:
    """Damage one file of a folder in one way, or in a few."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = files[rng.integers(len(files))]
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        ways = (*BYTES, *OF_SUFFIX.get(path.suffix, ()) * 4)  # what knows the format gets deeper
        data = ways[rng.integers(len(ways))](rng, path.read_bytes())
        path.write_bytes(data)


def value(rng: Rng) -> Any:
    """A value that hardly anything expects."""
    kind = (NUMBERS, TEXTS, OTHERS)[rng.integers(3)]
    return kind[rng.integers(len(kind))]


def _truncated(rng: Rng, data: bytes) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _flipped(rng: Rng, data: bytes) -> bytes:
    raw = bytearray(data)
    for _ in range(rng.integers(1, 9) if raw else 0):
        raw[rng.integers(len(raw))] ^= 1 << rng.integers(8)
    return bytes(raw)


def _huge_length(rng: Rng, data: bytes) -> bytes:
    """A number of 1, 2, 4 or 8 bytes becomes the greatest, or a very great one."""
    size = int(rng.choice([1, 2, 4, 8]))
    at = int(rng.integers(max(len(data) - size, 1)))
    great = (b"\xff" * size, b"\xff" * (size - 1) + b"\x7f", b"\0" * (size - 1) + b"\x40", b"\0" * size)
    return data[:at] + great[rng.integers(len(great))] + data[at + size :]


def _spliced(rng: Rng, data: bytes) -> bytes:
    """A part of the file stands where another was."""
    one, other, length = (int(rng.integers(len(data) + 1)) for _ in range(3))
    return data[:one] + data[other : other + length] + data[one + int(rng.integers(2)) * length :]


def _noisy(rng: Rng, data: bytes) -> bytes:
    at, length = int(rng.integers(len(data) + 1)), int(rng.integers(1, 65))
    return data[:at] + rng.bytes(length) + data[at + length :]


BYTES: tuple[Callable[[Rng, bytes], bytes], ...] = (_truncated, _flipped, _huge_length, _spliced, _noisy)


def _word_replaced(rng: Rng, data: bytes) -> bytes:
    """A word of a text becomes another value."""
    words = data.split(b" ")
    words[rng.integers(len(words))] = str(value(rng)).encode("utf-8", "replace")
    return b" ".join(words)


def _tree(rng: Rng, tree: Any, depth: int = 0) -> Any:
    """A value, with one of its parts replaced, removed, repeated or nested."""
    if not isinstance(tree, dict | list) or not tree or rng.random() < 0.15 * depth:
        return (value(rng), [tree], {"x": tree}, [tree] * 3)[rng.integers(4) if rng.random() < 0.3 else 0]
    if isinstance(tree, list):
        at = int(rng.integers(len(tree)))
        how = rng.random()
        if how < 0.1:
            return tree[:at] + tree[at + 1 :]
        if how < 0.2:
            return tree + [tree[at]] * int(rng.integers(1, 50))
        return [*tree[:at], _tree(rng, tree[at], depth + 1), *tree[at + 1 :]]
    keys = list(tree)
    key, how = keys[rng.integers(len(keys))], rng.random()
    rest = {name: part for name, part in tree.items() if name != key}
    if how < 0.1:
        return rest
    if how < 0.2:
        return {**rest, TEXTS[rng.integers(len(TEXTS))]: tree[key]}
    return {**tree, key: _tree(rng, tree[key], depth + 1)}


def _yaml(rng: Rng, data: bytes) -> bytes:
    try:
        tree = yaml.safe_load(data)
    except Exception:  # damaged before
        return _flipped(rng, data)
    if rng.random() < 0.05:
        return b"a: " + b"[" * int(rng.integers(1, 3000))
    return yaml.safe_dump(_tree(rng, tree), allow_unicode=True).encode("utf-8", "surrogatepass")


def _bomb(rng: Rng, data: bytes) -> bytes:
    """YAML with aliases that unfold to a billion parts."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9)]
    return "\n".join(lines).encode() + b"\n" + data


def _json_text(rng: Rng, data: bytes) -> bytes:
    """One line of JSON, or the whole file, with another value in it."""
    lines = data.splitlines(keepends=True)
    single = len(lines) > 1 and _is_json(lines[0])
    at = int(rng.integers(len(lines))) if single else 0
    try:
        tree = json.loads(lines[at] if single else data)
    except Exception:  # damaged before
        return _flipped(rng, data)
    new = json.dumps(_tree(rng, tree)).encode() + b"\n"
    if rng.random() < 0.05:
        new = b"[" * int(rng.integers(1, 200_000))
    return b"".join([*lines[:at], new, *lines[at + 1 :]]) if single else new


def _is_json(line: bytes) -> bool:
    try:
        json.loads(line)
    except (ValueError, RecursionError):
        return False
    return True


def _picture_size(rng: Rng, data: bytes) -> bytes:
    """A PNG whose header tells another size, with the right checksum."""
    if len(data) < 33 or not data.startswith(b"\x89PNG"):
        return _flipped(rng, data)
    sides = (0, 1, 4096, 4097, 60_000, 2**31 - 1, 2**32 - 1)
    size = struct.pack(">II", *(sides[rng.integers(len(sides))] for _ in range(2)))
    header = b"IHDR" + size + data[24:29]
    return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]


def _netpbm_size(rng: Rng, data: bytes) -> bytes:
    numbers = (b"0", b"-1", b"60000", b"99999999999", b"65536", b"x")
    return b"P5 %s %s %s\n" % tuple(numbers[rng.integers(len(numbers))] for _ in range(3)) + data[15:]


def _columns(rng: Rng, data: bytes) -> bytes:
    """A Parquet file with columns that are missing, renamed, repeated, of another type, or empty."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(data))
        names = table.column_names
    except Exception:  # damaged before
        return _flipped(rng, data)
    if not table.num_columns:
        return _flipped(rng, data)
    at, rows = int(rng.integers(table.num_columns)), table.num_rows
    name = names[at]
    others = (
        pa.nulls(rows), pa.array(["x"] * rows), pa.array([2**62] * rows), pa.array([float("nan")] * rows),
        pa.array([b"\xff"] * rows), pa.array([[1, 2]] * rows), pa.array([{"a": 1}] * rows), pa.array([-1] * rows),
        pa.array([1e308] * rows), pa.array([True] * rows), pa.array([None, *[1] * (rows - 1)][:rows]),
    )  # fmt: skip
    how = int(rng.integers(6))
    if how == 0:
        table = table.remove_column(at)
    elif how == 1:
        table = table.slice(0, int(rng.integers(rows + 1)))
    elif how == 2:
        table = table.append_column(str(rng.choice(["", "x", name, "system"])), table.column(at))
    else:
        table = table.set_column(at, name, others[rng.integers(len(others))])
    out = io.BytesIO()
    try:
        pq.write_table(table, out)
    except pa.ArrowException:  # such a table cannot be written
        return _flipped(rng, data)
    return out.getvalue()


OF_SUFFIX: dict[str, tuple[Callable[[Rng, bytes], bytes], ...]] = {
    ".yaml": (_yaml, _yaml, _yaml, _word_replaced, _bomb),
    ".json": (_json_text,),
    ".jsonl": (_json_text,),
    ".journal": (_json_text,),
    ".png": (_picture_size,),
    ".pgm": (_netpbm_size,),
    ".parquet": (_columns,),
    ".world": (_word_replaced,),
    ".txt": (_word_replaced,),
}
