"""LaTeX from templates, in which every text is escaped unless it is marked as LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from runners.config.escaping import latex_text

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


class Latex(str):
    """Text that is LaTeX already, so that it is not escaped again."""


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


def float_table(
    lines: Sequence[Sequence[str]], columns: str, label: str, caption: str, notes: Sequence[str]
) -> Latex:
    r"""Return a table as a float for `\input`, with booktabs rules, its notes below it, and a caption.

    lines: the header first. columns: alignment of each, "lrr". label: for `\ref`.
    """
    return render(_FLOAT, lines=lines, columns=columns, label=Latex(label), caption=caption, notes=notes)
