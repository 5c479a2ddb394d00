"""The sensitivity study: how the results change when one parameter is multiplied by a factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from runners.config.escaping import markdown_text
from runners.config.weights import scale_from_words
from runners.config.wording import markdown_table
from runners.records.launch_record import read_launch
from runners.records.whole_file import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS, Block, Difference, signed
from runners.reports.analysis.summary import DASH, INTERVAL_NOTE, TIMES, Row
from runners.reports.analysis.tables import title

if TYPE_CHECKING:
    import pandas as pd

COLUMN, UNCHANGED = "scale", ""
NAME = "sensitivity"
NAMES = {SUCCESS: "success", METRIC: "BARN metric"}
NOTES = (
    "Range: the highest minus the lowest success rate over the factors, including 1. Bold: differs from that at 1 "
    "beyond the noise, by the amount in brackets.",
    f"The picture's band: 95 %, {INTERVAL_NOTE}",
)


@dataclass(frozen=True, slots=True)
class Point:
    """One factor of one parameter. change: difference from factor 1, by measure; empty at factor 1."""

    factor: float
    row: Row
    change: dict[str, Difference]

    @property
    def success(self) -> float:
        """The success rate."""
        return self.row.stats[SUCCESS][0]


@dataclass(frozen=True, slots=True)
class ParameterCurve:
    """Points of one parameter by increasing factor. value: the parameter at factor 1; empty if unknown."""

    parameter: str
    value: str
    points: tuple[Point, ...]

    @property
    def unchanged(self) -> Point:
        """The point at factor 1."""
        return next(point for point in self.points if point.factor == 1)

    @property
    def range(self) -> float:
        """Largest minus smallest success rate over the factors."""
        rates = [point.success for point in self.points]
        return max(rates) - min(rates)

    def beyond(self, measure: str) -> list[Point]:
        """Points whose difference from factor 1 in the measure is beyond the noise."""
        return [each for each in self.points if measure in each.change and each.change[measure].beyond_noise]


@dataclass(frozen=True, slots=True)
class SensitivityStudy:
    """Curves of one system in one setting, in the order of the sweep. heading: the system. place: the setting."""

    heading: str
    place: str
    curves: tuple[ParameterCurve, ...]


def studies(frame: pd.DataFrame) -> list[SensitivityStudy]:
    """One study for each system and setting with both unchanged and multiplied parameters.

    Runs with several multiplied parameters are ignored.
    """
    found = [_study(block) for block in paired.blocks(_single(frame), COLUMN, UNCHANGED)]
    return [study for study in found if study.curves]


def sentences(found: list[SensitivityStudy]) -> list[str]:
    """A line for each parameter, the one with the largest range first."""
    lines = []
    for study in found:
        lines.append(f"{study.heading}, {study.place}: success over the factors of each parameter.")
        lines += [_sentence(curve) for curve in sorted(study.curves, key=lambda curve: -curve.range)]
    return lines


def write(found: list[SensitivityStudy], place: Path) -> list[Path]:
    """Write `sensitivity.md` and `sensitivity.csv` into `place`; return their paths."""
    markdown, table = place / f"{NAME}.md", place / f"{NAME}.csv"
    write_atomically(markdown, to_markdown(found))
    points = [(study, curve, point) for study in found for curve in study.curves for point in curve.points]
    paired.write_csv([_numbers(*point) for point in points], table)
    return [markdown, table]


def to_markdown(found: list[SensitivityStudy]) -> str:
    """Success rate and BARN metric by factor, with a list of sentences below the tables of each study."""
    parts = []
    for study in found:
        lines = "\n".join(f"- {line}" for line in sentences([study])[1:])
        parts += [
            f"**{study.heading} · {study.place}**",
            _table(study, SUCCESS),
            _table(study, METRIC) if scored([study]) else "",
            lines,
        ]
    return "\n\n".join([*(part for part in parts if part), "  \n".join([*paired.NOTES, *NOTES])]) + "\n"


def scored(found: Sequence[SensitivityStudy]) -> bool:
    """Whether some records have the BARN metric."""
    return any(
        METRIC in point.row.stats for study in found for curve in study.curves for point in curve.points
    )


def factors(curves: Sequence[ParameterCurve]) -> list[float]:
    """All factors of some curves, increasing."""
    return sorted({point.factor for curve in curves for point in curve.points})


def _single(frame: pd.DataFrame) -> pd.DataFrame:
    """Records of runs with at most one multiplied parameter."""
    if COLUMN not in frame:
        return frame
    return frame[[len(scale_from_words(text)) <= 1 for text in frame[COLUMN].fillna(UNCHANGED)]]


def _study(block: Block) -> SensitivityStudy:
    changes = {measure: paired.compare(block, measure) for measure in (SUCCESS, METRIC)}
    base = Point(1.0, paired.row(block.baseline), {})
    by_parameter: dict[str, list[Point]] = {}
    for name, part in block.variants.items():
        ((parameter, factor),) = scale_from_words(name).items()
        change = {measure: found[name] for measure, found in changes.items() if name in found}
        by_parameter.setdefault(parameter, [base]).append(Point(factor, paired.row(part), change))
    curves = (
        ParameterCurve(name, _value(block, name), tuple(sorted(points, key=lambda point: point.factor)))
        for name, points in by_parameter.items()
    )
    return SensitivityStudy(block.heading, title(block.baseline), tuple(curves))


def _value(block: Block, parameter: str) -> str:
    """The unchanged value of the parameter; empty if unknown."""
    launch = read_launch(Path(block.baseline["run_dir"].iloc[0])) if "run_dir" in block.baseline else None
    parameters = launch.configs[0]["guide"].get("parameters", {}) if launch is not None else {}
    return str(parameters.get(parameter, ""))


def _sentence(curve: ParameterCurve) -> str:
    rates = [point.success for point in curve.points]
    value = f" ({curve.value})" if curve.value else ""
    found = [text for measure in (SUCCESS, METRIC) if (text := _beyond(curve, measure))]
    verdict = f"beyond the noise: {'; '.join(found)}" if found else "nothing beyond the noise"
    return (
        f"{curve.parameter}{value}: {min(rates):.3f} to {max(rates):.3f}, range {curve.range:.3f}; {verdict}."
    )


def _beyond(curve: ParameterCurve, measure: str) -> str:
    """ "success 0.020 at × 0"; empty if no point is beyond the noise."""
    points = curve.beyond(measure)
    shown = ", ".join(f"{point.row.stats[measure][0]:.3f} at {TIMES} {point.factor:g}" for point in points)
    return f"{NAMES[measure]} {shown}" if shown else ""


def _table(study: SensitivityStudy, measure: str) -> str:
    """A line for each parameter and a column for each factor; bold beyond the noise."""
    columns = factors(study.curves)
    if not any(measure in point.row.stats for curve in study.curves for point in curve.points):
        return ""
    lines = [[NAMES[measure], "Value", *(f"{TIMES} {factor:g}" for factor in columns)]]
    lines.append(["---", *["---:"] * (len(columns) + 1)])
    for curve in study.curves:
        cells = {point.factor: _cell(point, measure) for point in curve.points}
        lines.append(
            [
                markdown_text(curve.parameter),
                markdown_text(curve.value) or DASH,
                *(cells.get(factor, DASH) for factor in columns),
            ]
        )
    return markdown_table(lines)


def _cell(point: Point, measure: str) -> str:
    if measure not in point.row.stats:
        return DASH
    text = f"{point.row.stats[measure][0]:.3f}"
    change = point.change.get(measure)
    return f"**{text}** ({signed(change.mean)})" if change and change.beyond_noise else text


def _numbers(study: SensitivityStudy, curve: ParameterCurve, point: Point) -> dict[str, object]:
    """A line of the CSV, not rounded."""
    known = {
        "block": study.heading,
        "place": study.place,
        "parameter": curve.parameter,
        "value": curve.value,
        "factor": point.factor,
    }
    return {**known, **paired.to_mapping(point.row, point.change)}
