"""Tables as plain text and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Mapping, Sequence

from runners.config.escaping import csv_value, visible


def aligned(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    """Return one line per row, with cells padded to the width of their column. right: the right-aligned columns."""
    rows = [[visible(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def csv_text(lines: Sequence[Mapping[str, object]]) -> str:
    """Return a CSV with every column that any line has, in order of first appearance."""
    names = list(dict.fromkeys(name for line in lines for name in line))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writerow({name: csv_value(name) for name in names})
    writer.writerows({name: csv_value(value) for name, value in line.items()} for line in lines)
    return text.getvalue()
