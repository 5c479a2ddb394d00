"""The studies of a sweep: what its records show about systems, ablations, parameters or values of a key."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from runners.records.atomic_write import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.tables import csv_text
from runners.reports.figures.style import save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

T = TypeVar("T")


class SweepStudy(ABC):
    """One setting of a study: sentences for the terminal, tables for `NAME.md`, lines for `NAME.csv`.

    Some also have a table for `NAME.tex`.
    """

    __slots__ = ()
    name: ClassVar[str]  # stem of the files
    legend: ClassVar[str] = ""  # what a reader of the picture must know

    @classmethod
    @abstractmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return one study for each setting of the records that allows it. frame: one row per episode."""

    @abstractmethod
    def sentences(self) -> list[str]:
        """Return the results as lines for the terminal."""

    @abstractmethod
    def tables(self) -> list[str]:
        """Return headings, tables and lists in Markdown."""

    @abstractmethod
    def lines(self) -> Iterable[dict[str, object]]:
        """Return the lines of the CSV, not rounded."""

    def to_latex(self, label: str) -> str:
        """Return the main table as a LaTeX float with this label; empty if there is none."""
        return ""

    def notes(self) -> Sequence[str]:
        """Return what explains the tables. Studies of one kind share their notes."""
        return paired.NOTES

    @classmethod
    def figure(cls, studies: Sequence[Self]) -> Figure | None:
        """Return the picture of the studies, if there is one."""
        return None


def write(studies: Sequence[SweepStudy], folder: Path) -> list[Path]:
    """Write the tables and pictures of all studies of one kind into `folder`; return the paths."""
    figure = studies[0].figure(studies)
    pictures = [] if figure is None else save(figure, folder / studies[0].name, ("png", "pdf"))
    return [*write_tables(studies, folder), *pictures]


def write_tables(studies: Sequence[SweepStudy], folder: Path) -> list[Path]:
    """Write the tables of all studies of one kind into `folder`; return the paths."""
    name = studies[0].name
    floats = [study.to_latex(label) for study, label in zip(studies, labels(name, len(studies)), strict=True)]
    texts = {
        "md": to_markdown(studies),
        "csv": csv_text([line for study in studies for line in study.lines()]),
        **({"tex": "\n".join(floats)} if any(floats) else {}),
    }
    for ending, text in texts.items():
        write_atomically(folder / f"{name}.{ending}", text)
    return [folder / f"{name}.{ending}" for ending in texts]


def labels(name: str, count: int) -> list[str]:
    r"""Return what `\\ref` calls the LaTeX tables of this name: tab:NAME, or tab:NAME-1 and so on for several."""
    return [f"tab:{name}"] if count == 1 else [f"tab:{name}-{number}" for number in range(1, count + 1)]


def worst_and_best(items: Sequence[T], score: Callable[[T], Any], most: int) -> list[T]:
    """Return at most `most` of the items, in their order: as many of the lowest scores as of the highest."""
    if len(items) <= most:
        return list(items)
    ranked = sorted(range(len(items)), key=lambda number: score(items[number]))
    worst = most // 2
    return [items[number] for number in sorted([*ranked[:worst], *ranked[worst - most :]])]


def to_markdown(studies: Sequence[SweepStudy]) -> str:
    """Return the tables of all studies of one kind, and their notes at the end."""
    notes = dict.fromkeys(note for study in studies for note in study.notes())
    tables = [table for study in studies for table in study.tables()]
    return "\n\n".join([*tables, "  \n".join(notes)] if notes else tables) + "\n"
