"""Formats a table as plain text."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from runners.config.escaping import visible


def aligned(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    """One line per row, with cells padded to the width of their column. right: columns that are right-aligned."""
    rows = [[visible(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
