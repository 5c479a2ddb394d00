"""Results over the values of a changed key, such as `sim.latency`, with a curve for each system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from runners.config.escaping import markdown_text
from runners.config.wording import markdown_table
from runners.records.whole_file import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS
from runners.reports.analysis.summary import DASH, Row, as_text, changed_columns, row_keys
from runners.reports.analysis.tables import title

if TYPE_CHECKING:
    import pandas as pd

NAME = "curves"
LEAST = 3  # minimum number of values that make a curve
AT = "at"  # column of the key's number
EPISODE = ["world", "run"]
NAMES = {SUCCESS: "success", "collision": "collision", METRIC: "BARN metric"}


@dataclass(frozen=True, slots=True)
class Curve:
    """A row of figures for each value of the key, in increasing order. label: the system and what else varies."""

    label: str
    points: tuple[tuple[float, Row], ...]


@dataclass(frozen=True, slots=True)
class CurveStudy:
    """The curves over one key, with all other keys as in the options' files. place: map, robot, worlds and runs."""

    key: str
    place: str
    curves: tuple[Curve, ...]

    @property
    def values(self) -> list[float]:
        """All values of the key, increasing."""
        return sorted({value for curve in self.curves for value, _ in curve.points})


def studies(frame: pd.DataFrame) -> list[CurveStudy]:
    """A study for each changed key with at least LEAST numbers within a system."""
    keys = [key for key in changed_columns(frame) if _is_curve(frame, key)]
    found = [_study(_alone(frame, key, keys), key) for key in keys]
    return [study for study in found if study.curves]


def sentences(found: list[CurveStudy]) -> list[str]:
    """A line for each curve: success at the smallest and the largest value of the key."""
    return [
        f"{curve.label}: success {_rate(curve.points[0][1])} at {study.key}={curve.points[0][0]:g}, "
        f"{_rate(curve.points[-1][1])} at {curve.points[-1][0]:g}."
        for study in found
        for curve in study.curves
    ]


def write(found: list[CurveStudy], place: Path) -> list[Path]:
    """Write `curves.md` and `curves.csv` into `place`; return their paths."""
    markdown, table = place / f"{NAME}.md", place / f"{NAME}.csv"
    write_atomically(markdown, to_markdown(found))
    lines = [
        {"key": study.key, "value": value, "curve": curve.label, **paired.to_mapping(row, {})}
        for study in found
        for curve in study.curves
        for value, row in curve.points
    ]
    paired.write_csv(lines, table)
    return [markdown, table]


def to_markdown(found: list[CurveStudy]) -> str:
    """For each key and measure, a table with a line for each curve and a column for each value."""
    headings = [markdown_text(f"{study.key} · {study.place}") for study in found]
    parts = [
        "\n\n".join([f"**{heading}**", *_tables(study)])
        for heading, study in zip(headings, found, strict=True)
    ]
    return "\n\n".join(parts) + "\n"


def _is_curve(frame: pd.DataFrame, key: str) -> bool:
    """Whether some system has at least LEAST numbers for the key."""
    values = _numbers(frame[key])
    return bool(values.notna().all() and values.groupby(frame["system"]).nunique().max() >= LEAST)


def _alone(frame: pd.DataFrame, key: str, keys: Sequence[str]) -> pd.DataFrame:
    """Records in which no other key is changed, each episode once, with the key's number as AT."""
    others = {other for other in keys if other != key}
    changed = frame["changes"].map(lambda text: {part.partition("=")[0] for part in text.split(", ")})
    part = frame[[others.isdisjoint(each) for each in changed]]
    part = part.drop(columns=[*others, "changes", "run_dir"]).assign(**{AT: _numbers(part[key])})
    settings = [name for name in ("system", *row_keys(part), *EPISODE) if name != key]
    return part.drop(columns=key)[~part.duplicated([AT, *settings])]


def _study(part: pd.DataFrame, key: str) -> CurveStudy:
    keys = ["system", *(name for name in row_keys(part.drop(columns=AT)) if part[name].nunique() > 1)]
    texts = part.assign(**{name: as_text(part[name]) for name in keys})
    found = [curve for names, group in texts.groupby(keys, sort=False) for curve in _curve(names, group)]
    return CurveStudy(key, title(part), tuple(found))


def _curve(names: tuple[object, ...], group: pd.DataFrame) -> Iterator[Curve]:
    points = tuple((float(str(value)), paired.row(rows)) for value, rows in group.groupby(AT))
    if len(points) >= LEAST:
        yield Curve(", ".join(str(name) for name in names if name), points)


def _numbers(column: pd.Series) -> pd.Series:
    import pandas as pd

    return pd.to_numeric(column, errors="coerce")


def _tables(study: CurveStudy) -> Iterator[str]:
    for measure, name in NAMES.items():
        if not any(measure in row.stats for curve in study.curves for _, row in curve.points):
            continue
        lines = [[name, *(f"{value:g}" for value in study.values)], ["---", *["---:"] * len(study.values)]]
        for curve in study.curves:
            rows = dict(curve.points)
            known = {value: row.stats[measure][0] for value, row in rows.items() if measure in row.stats}
            cells = (f"{known[v]:.3f}" if v in known else DASH for v in study.values)
            lines.append([markdown_text(curve.label), *cells])
        yield markdown_table(lines)


def _rate(row: Row) -> str:
    return f"{row.stats[SUCCESS][0]:.3f}"
