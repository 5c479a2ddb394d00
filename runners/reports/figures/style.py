"""The common style of all pictures: colours, lines, sizes and file formats.

Colours are those of Okabe and Ito (https://jfly.uni-koeln.de/color/), which differ for any colour vision. Line
styles, hatches and markers repeat the information for print in grey.
"""

from __future__ import annotations

import importlib
import io
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runners.config.escaping import plot_text
from runners.records.atomic_write import output_file, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from matplotlib.transforms import Bbox
    from matplotlib.typing import LineStyleType

ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
INK, OBSTACLE, FRAME, GRID = "#333333", "#9A9A9A", "#BBBBBB", "#DDDDDD"
DPI = 200
COLUMN_IN, PAGE_IN = 3.5, 7.16  # widths of one column, and of two, of an IEEE page
TEXT_GAP_IN = 0.06  # around the texts above and below a picture
BEYOND = "beyond"  # marks these texts
_NARROWEST = 0.27  # of the size of the font: width of its narrowest letters, such as i
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


class PicturePage(NamedTuple):
    """What the user sets for a picture. None: as it is by itself; an empty text: none."""

    title: str | None = None
    caption: str | None = None
    width_in: float | None = None


USUAL = PicturePage()
_PAGE = ContextVar("page", default=USUAL)


@contextmanager
def drawn_on(page: PicturePage) -> Iterator[None]:
    """Draw the pictures of this context on such pages."""
    token = _PAGE.set(page)
    try:
        yield
    finally:
        _PAGE.reset(token)


def page_width(usual_in: float) -> float:
    """Return the width of the picture [in]."""
    return _PAGE.get().width_in or usual_in


def entitle(figure: Figure, title: str = "", caption: str = "", subtitle: str = "") -> None:
    """Write a title above a picture and a caption below it, wrapped to its width; `save` adds the space for both.

    They are the picture's own: those of the page replace them. subtitle: goes with the picture's own title.
    """
    page = _PAGE.get()
    if page.title is not None:
        title, subtitle = page.title, ""
    caption = caption if page.caption is None else page.caption
    # From the picture's upper edge upwards, and from its lower edge downwards.
    above, below = figure.get_figheight() + TEXT_GAP_IN, -TEXT_GAP_IN
    for text, size, weight in ((subtitle, 8.0, "normal"), (title, 9.0, "bold")):
        above = _write_lines(figure, text, above, size, weight, "bottom")
    _write_lines(figure, caption, below, 7.0, "normal", "top")


def _write_lines(figure: Figure, text: str, y_in: float, size: float, weight: str, va: str) -> float:
    """Write lines at the left, beyond a height of the picture; return the height at their upper end [in]."""
    if not text.strip():
        return y_in
    width, height = figure.get_size_inches()
    renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]  # of Agg
    lines = [
        line for part in text.split("\n") for line in _fitting(part, width - 2 * TEXT_GAP_IN, size, weight)
    ]
    written = figure.text(
        TEXT_GAP_IN / width, y_in / height, plot_text("\n".join(lines)), va=va, ha="left", fontsize=size,
        fontweight=weight, color=INK, in_layout=False, gid=BEYOND,
    )  # fmt: skip
    return float(written.get_window_extent(renderer).y1 / figure.dpi) + TEXT_GAP_IN


def _fitting(text: str, width_in: float, size: float, weight: str) -> list[str]:
    """Return the text in lines that fit into a width."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size, weight=weight)

    @cache
    def fits(line: str) -> bool:
        width, *_ = text_to_path.get_text_width_height_descent(line, font, ismath=False)
        return width / 72 <= width_in

    # From as many of the narrowest letters as fit downwards; many numbers of letters wrap to the same lines.
    letters = max(min(len(text), int(width_in * 72 / (_NARROWEST * size))), 1)
    while letters > 1 and not all(map(fits, textwrap.wrap(text, letters))):
        letters -= 1
    return textwrap.wrap(text, letters) or [""]


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
        figure.savefig(buffer, format=ending, metadata=_NO_DATES[ending], bbox_inches=saved_area(figure))
    return buffer.getbuffer()


def saved_area(figure: Figure) -> Bbox | None:
    """Lay a picture out, and return it with the texts beyond its edges [in]; None if there are none."""
    from matplotlib.transforms import Bbox

    texts = [text for text in figure.texts if text.get_gid() == BEYOND]
    if not texts:
        return None
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    # Legends stay with the picture instead of moving to the edge of the larger page.
    for legend in figure.legends:
        if legend.get_bbox_to_anchor() is figure.bbox:
            legend.set_bbox_to_anchor((0.0, 0.0, 1.0, 1.0), transform=figure.transFigure)
    width, height = figure.get_size_inches()
    extents = [text.get_window_extent() for text in texts]
    low = min(0.0, *(extent.y0 / figure.dpi - TEXT_GAP_IN for extent in extents))
    high = max(height, *(extent.y1 / figure.dpi + TEXT_GAP_IN for extent in extents))
    return Bbox.from_extents(0.0, low, width, high)


def symbol(name: str) -> str:
    """Return a name in math text as in the paper: "a_close" and "d1" get a subscript; other names are unchanged."""
    letter, index = name[:1], name[1:].removeprefix("_")
    is_symbol = letter in "acd" and index.isalnum() and (name[1:2] == "_" or index.isdigit())
    return rf"${letter}_{{\mathrm{{{index}}}}}$" if is_symbol else plot_text(name)
