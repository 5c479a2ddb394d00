"""A table of text cells, for Markdown and LaTeX."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from runners.config.escaping import latex_text, markdown_table, markdown_text
from runners.reports.analysis.latex import Latex, float_table


class Strong(str):
    """A cell that stands out, in bold."""


@dataclass(frozen=True, slots=True)
class TextTable:
    """A header and lines of cells. left: numbers of the columns that hold words; the others hold numbers."""

    header: Sequence[str]
    lines: Sequence[Sequence[str]]
    left: Collection[int] = (0,)

    def without(self, *headers: str) -> TextTable:
        """Return the table without the columns that have these headers."""
        kept = [number for number, header in enumerate(self.header) if header not in headers]
        lines = [[line[number] for number in kept] for line in (self.header, *self.lines)]
        return TextTable(
            lines[0], lines[1:], [place for place, number in enumerate(kept) if number in self.left]
        )

    def to_markdown(self) -> str:
        """Return the table in GitHub's Markdown."""
        rule = ["---" if number in self.left else "---:" for number in range(len(self.header))]
        return markdown_table([self.header, rule, *(map(_in_markdown, line) for line in self.lines)])

    def to_latex(self, label: str, caption: str, notes: Sequence[str] = ()) -> Latex:
        """Return the table as a float with a caption and notes; see `float_table`."""
        columns = "".join("l" if number in self.left else "r" for number in range(len(self.header)))
        return float_table([self.header, *self._grouped()], columns, label, caption, notes)

    def _grouped(self) -> Iterator[list[Latex]]:
        """Yield the lines; where several begin with one name, it is written once, and groups are set apart."""
        names = [line[0] for line in self.lines]
        are_groups = len(set(names)) < len(names)
        for number, line in enumerate(self.lines):
            name, *cells = map(_in_latex, line)
            if are_groups and number and names[number] == names[number - 1]:
                name = Latex()
            elif are_groups and number:
                name = Latex(rf"\addlinespace {name}")
            yield [name, *cells]


def _in_markdown(cell: str) -> str:
    text = markdown_text(cell)
    return f"**{text}**" if isinstance(cell, Strong) else text


def _in_latex(cell: str) -> Latex:
    text = latex_text(cell)
    return Latex(rf"\textbf{{{text}}}" if isinstance(cell, Strong) else text)
