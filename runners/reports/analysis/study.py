"""The studies of a sweep: what its records show about systems, ablations, parameters or values of a key."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from runners.records.atomic_write import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.tables import csv_text

if TYPE_CHECKING:
    import pandas as pd


class SweepStudy(ABC):
    """One setting of a study: sentences for the terminal, tables for `NAME.md`, lines for `NAME.csv`."""

    __slots__ = ()
    name: ClassVar[str]  # stem of the files

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

    def notes(self) -> Sequence[str]:
        """Return what explains the tables. Studies of one kind share their notes."""
        return paired.NOTES

    @classmethod
    def draw(cls, studies: Sequence[Self], folder: Path) -> list[Path]:
        """Draw the studies as `NAME.png` and `NAME.pdf` in `folder`, if there is a picture; return the paths."""
        return []


def write(studies: Sequence[SweepStudy], folder: Path) -> list[Path]:
    """Write the tables and pictures of all studies of one kind into `folder`; return the paths."""
    name = studies[0].name
    markdown, table = folder / f"{name}.md", folder / f"{name}.csv"
    write_atomically(markdown, to_markdown(studies))
    write_atomically(table, csv_text([line for study in studies for line in study.lines()]))
    return [markdown, table, *studies[0].draw(studies, folder)]


def to_markdown(studies: Sequence[SweepStudy]) -> str:
    """Return the tables of all studies of one kind, and their notes at the end."""
    notes = dict.fromkeys(note for study in studies for note in study.notes())
    tables = [table for study in studies for table in study.tables()]
    return "\n\n".join([*tables, "  \n".join(notes)] if notes else tables) + "\n"
