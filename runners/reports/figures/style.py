"""The common style of all pictures: colours, lines, sizes and file formats.

Colours are those of Okabe and Ito (https://jfly.uni-koeln.de/color/), which differ for any colour vision. Line
styles, hatches and markers repeat the information for print in grey.
"""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runners.config.escaping import plot_text
from runners.records.atomic_write import output_file, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from matplotlib.typing import LineStyleType

ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
INK, OBSTACLE, FRAME, GRID = "#333333", "#9A9A9A", "#BBBBBB", "#DDDDDD"
DPI = 200
FORMATS = ("png", "pdf", "svg")


class Style(NamedTuple):
    """The style of the paths of one outcome or system."""

    colour: str
    line: LineStyleType  # by name, or offset and dashes
    marker: str  # at the end of the path


STYLES = {  # worst first
    "collision": Style(VERMILION, "-", "X"),
    "timeout": Style(BLUE, "--", "s"),
    "success": Style(GREEN, "-", ""),
}
LEGEND_ORDER = ("success", "collision", "timeout")
OUTCOMES = ("success", "timeout", "collision")  # of stacked bars, from the axis on
HATCHES = {"collision": "////", "timeout": "...."}
END: dict[str, Any] = {"markersize": 6, "markeredgecolor": "white", "markeredgewidth": 0.6}

_NO_DATES: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
# Keep text as text.
_PRINT: dict[Any, Any] = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "lme"}


def new_figure(width_in: float, height_in: float, dpi: int = DPI, layout: Any = "constrained") -> Figure:
    """Return an empty figure with a canvas that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if "IPython" in sys.modules:
        # Matplotlib asks for its version. MLflow, in a thread of its own, may be importing it: this waits for the end.
        importlib.import_module("IPython")
    figure = Figure(figsize=(width_in, height_in), dpi=dpi, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def filled(outcome: str) -> dict[str, Any]:
    """Return the look of the bars of an outcome."""
    colour, hatch = STYLES[outcome].colour, HATCHES.get(outcome)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.4}


def outcome_keys() -> list[Patch]:
    """Return the entries of a key for bars of outcomes."""
    from matplotlib.patches import Patch

    return [Patch(label=outcome, **filled(outcome)) for outcome in OUTCOMES]


def save(figure: Figure, stem: Path, formats: Sequence[str] = ("png",)) -> list[Path]:
    """Save a figure as `stem`.png, …, and return the paths. Equal figures give equal bytes."""
    paths = [stem.with_name(f"{stem.name}.{ending}") for ending in formats]
    for path, ending in zip(paths, formats, strict=True):
        with replacing(path) as draft:
            draft.write_bytes(picture(figure, ending))
    return paths


def save_as(figure: Figure, path: Path, ending: str) -> None:
    """Save a figure in the file, pipe or device that the user named. Raises OSError."""
    with output_file(path) as draft:
        draft.write_bytes(picture(figure, ending))


def picture(figure: Figure, ending: str) -> memoryview:
    """Return the bytes of a figure's file.

    They are not drawn into the file directly: on a full disk, Matplotlib fails for other reasons.
    """
    from matplotlib import rc_context

    with rc_context(_PRINT):
        buffer = io.BytesIO()
        figure.savefig(buffer, format=ending, metadata=_NO_DATES[ending])
    return buffer.getbuffer()


def symbol(name: str) -> str:
    """Return a name in math text as in the paper: "a_close" and "d1" get a subscript; other names are unchanged."""
    letter, index = name[:1], name[1:].removeprefix("_")
    is_symbol = letter in "acd" and index.isalnum() and (name[1:2] == "_" or index.isdigit())
    return rf"${letter}_{{\mathrm{{{index}}}}}$" if is_symbol else plot_text(name)
