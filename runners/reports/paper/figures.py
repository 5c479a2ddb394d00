"""Vector figures of a paper, as wide as a column or as the text of a two-column page."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lme.errors import InputError
from runners.reports.analysis.compare_pictures import PrintSpace, compare_figure
from runners.reports.analysis.compare_runs import RunComparison
from runners.reports.analysis.comparison import best_and_worst, chart, chart_notes
from runners.reports.analysis.study import SweepStudy, labels
from runners.reports.analysis.summary import Row
from runners.reports.analysis.tables import TableSetting, driven, shared_setting
from runners.reports.figures.driven_runs import runs_of
from runners.reports.figures.paths import sample_worlds, without_steps
from runners.reports.figures.style import COLUMN_IN, PAGE_IN, PicturePage, drawn_on, save
from runners.reports.figures.trajectories import COLUMNS, Trajectories, TrajectoriesFigureConfig

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TALL_IN = 8.0  # height of a figure, at most
_PANELS = 2  # worlds whose paths are drawn


class PaperFigure(NamedTuple):
    """A figure for `main.tex`. name: its file in figures/, without the ending. wide: whether it spans both columns."""

    name: str
    label: str
    caption: str
    wide: bool


def draw(
    frame: pd.DataFrame,
    rows: Sequence[Row],
    run_dirs: Sequence[Path],
    comparisons: Sequence[RunComparison],
    studies: Sequence[Sequence[SweepStudy]],
    folder: Path,
) -> list[PaperFigure]:
    """Draw what the records allow, save it as PDF in `folder`, and return the figures in their order.

    Paths need worlds and steps: without those, a warning says why there are none.
    """
    setting, versions = shared_setting(frame), driven(frame)
    figures = []
    with drawn_on(PicturePage(title="", caption="")):  # the document has them
        for name, caption, wide, figure in _charts(rows, setting, versions, comparisons, studies):
            save(figure, folder / name, ("pdf",))
            figures.append(PaperFigure(name, f"fig:{name}", caption, wide))
        return [*figures, *_paths(frame, run_dirs, f"{setting}, {versions}", folder)]


def _charts(
    rows: Sequence[Row],
    setting: TableSetting,
    versions: str,
    comparisons: Sequence[RunComparison],
    studies: Sequence[Sequence[SweepStudy]],
) -> Iterator[tuple[str, str, bool, Figure]]:
    """Yield name, caption, whether it is wide, and the chart: outcomes, comparisons, and a study of each kind."""
    if len(rows) > 1:
        drawn = best_and_worst(rows)
        notes = " ".join(chart_notes(drawn, len(rows)))  # they name changed keys
        with drawn_on(PicturePage(width_in=COLUMN_IN)):
            figure = chart(drawn)
        yield "outcomes", f"Outcomes: {setting.short}, {versions}. {notes}", False, figure
    for label, comparison in zip(labels("worlds", len(comparisons)), comparisons, strict=True):
        figure, note = compare_figure(comparison, PrintSpace(PAGE_IN, TALL_IN))
        yield label.removeprefix("tab:"), f"World by world: {comparison.place}. {note}", True, figure
    for studies_of_kind in studies:
        picture = studies_of_kind[0].figure(studies_of_kind)
        legend = " ".join(studies_of_kind[0].legend.split())
        if picture is not None:
            yield (
                studies_of_kind[0].name,
                f"{studies_of_kind[0].name.capitalize()}: {setting}, {versions}. {legend}",
                True,
                picture,
            )


def _paths(frame: pd.DataFrame, run_dirs: Sequence[Path], facts: str, folder: Path) -> list[PaperFigure]:
    """Draw the paths in a few worlds, a column for each system. None, with a warning, if they cannot be drawn."""
    if without_steps(run_dirs):
        return []
    try:
        runs = runs_of(frame, run_dirs)
        if not runs:
            return []
        systems = len({run.label for run in runs})
        if systems > COLUMNS:
            return []
        worlds = sample_worlds(runs[0].frame, _PANELS)
        wide = systems > 1
        config = TrajectoriesFigureConfig("side_by_side", None, "none", PAGE_IN if wide else COLUMN_IN)
        Trajectories(config).draw(runs, worlds, folder / "paths", ("pdf",))
    except InputError as error:
        warnings.warn(f"no figure of the paths: {error}", stacklevel=4)
        return []
    return [PaperFigure("paths", "fig:paths", f"Paths of all runs in a sample of the worlds: {facts}.", wide)]
