"""A table of text cells, for Markdown and LaTeX, and LaTeX from templates.

In LaTeX, every text is escaped unless it is marked as LaTeX.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from runners.config.escaping import latex_text, markdown_table, markdown_text

# Longer notes than the table is wide wrap below it; a table that is too wide for the page shrinks with them.
_FLOAT = r"""% needs \usepackage{adjustbox,booktabs,threeparttable}
\begin{table*}
\centering
\caption{<< caption >>}
\label{<< label >>}
\smallskip
\footnotesize
\setlength{\tabcolsep}{4pt}
\begin{adjustbox}{max width=\linewidth}
\begin{threeparttable}
\begin{tabular}{@{}<< columns >>@{}}
\toprule
<% for line in lines %>
<% for cell in line %><% if not loop.first %> & <% endif %><< cell >><% endfor %> \\
<% if loop.first %>
\midrule
<% endif %>
<% endfor %>
\bottomrule
\end{tabular}
<% if notes %>
\begin{tablenotes}[flushleft]
<% for note in notes %>
\item << note >>
<% endfor %>
\end{tablenotes}
<% endif %>
\end{threeparttable}
\end{adjustbox}
\end{table*}
"""


class Strong(str):
    """A cell that stands out, in bold."""


class Latex(str):
    """Text that is LaTeX already, so that it is not escaped again."""


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
        left = [column for column, number in enumerate(kept) if number in self.left]
        return TextTable(lines[0], lines[1:], left)

    def to_markdown(self) -> str:
        """Return the table in GitHub's Markdown."""
        rule = ["---" if number in self.left else "---:" for number in range(len(self.header))]
        return markdown_table([self.header, rule, *(map(_in_markdown, line) for line in self.lines)])

    def to_latex(self, label: str, caption: str, notes: Sequence[str] = ()) -> Latex:
        r"""Return the table as a float for `\input`, with booktabs rules, its notes below it, and a caption.

        label: for `\ref`.
        """
        columns = "".join("l" if number in self.left else "r" for number in range(len(self.header)))
        lines = [self.header, *self._grouped()]
        return render(_FLOAT, lines=lines, columns=columns, label=Latex(label), caption=caption, notes=notes)

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


def render(template: str, **values: Any) -> Latex:
    """Return a template with its values in << >> and statements in <% %>. A text is escaped unless it is `Latex`."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
        finalize=lambda value: latex_text(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    return Latex(environment.from_string(template).render(values))
