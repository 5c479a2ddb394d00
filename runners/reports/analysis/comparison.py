"""Comparison of systems: differences of each row of the table from the reference system, episode by episode.

The reference is LME, or the system driven first if LME was not driven.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from runners.config.escaping import markdown_table
from runners.reports.analysis import paired
from runners.reports.analysis.paired import Block, Difference, interval, signed
from runners.reports.analysis.study import SweepStudy
from runners.reports.analysis.summary import DASH, METRICS, SETTING, SMOOTHNESS, Row, as_text, row_keys, usual
from runners.reports.analysis.tables import title

if TYPE_CHECKING:
    import pandas as pd

REFERENCE = "LME"
MEASURES = (paired.SUCCESS, paired.METRIC, SMOOTHNESS)
HEADERS = {metric.key: metric.header for metric in METRICS if metric.key in MEASURES}
ROW = "row"  # a column of the records: the row's name in the table


@dataclass(frozen=True, slots=True)
class Comparison(SweepStudy):
    """Differences of the other rows from the reference's row, in one setting. Its picture is the chart of the table.

    reference: its row's name in the table. changes: by row and measure. rows: all, the reference's first.
    """

    name: ClassVar[str] = "comparison"
    reference: str
    setting: str
    rows: Mapping[str, Row]
    changes: Mapping[str, Mapping[str, Difference]]

    @classmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return one comparison for each setting in which the reference and another system were driven.

        A setting is a combination of robot, map, subset, seed and whatever else varies within the reference system.
        """
        systems = list(dict.fromkeys(frame["system"]))
        reference = REFERENCE if REFERENCE in systems else systems[0]
        of_reference = frame["system"] == reference
        keys = row_keys(frame)
        settings = [key for key in keys if key in SETTING or as_text(frame[key][of_reference]).nunique() > 1]
        names = _names(frame, [key for key in keys if key not in settings])
        baseline = names[of_reference].iloc[0]
        blocks = paired.blocks(frame.assign(**{ROW: names}), ROW, baseline, settings)
        return [cls._of(block, baseline) for block in blocks]

    @classmethod
    def _of(cls, block: Block, reference: str) -> Self:
        import pandas as pd

        by_measure = {measure: paired.compare(block, measure) for measure in MEASURES}
        frames = {reference: block.baseline, **block.variants}
        return cls(
            reference,
            " · ".join(text for text in (block.heading, title(pd.concat(frames.values()))) if text),
            {name: paired.row(frame) for name, frame in frames.items()},
            {
                name: {measure: changes[name] for measure, changes in by_measure.items() if name in changes}
                for name in block.variants
            },
        )

    def sentences(self) -> list[str]:
        """Return a line for each row other than the reference's."""
        return [
            f"Paired differences from {self.reference}, {self.setting}:",
            *(
                f"{name}: {'; '.join(_describe_change(key, change) for key, change in changes.items())}."
                for name, changes in self.changes.items()
            ),
        ]

    def tables(self) -> list[str]:
        """Return a table with a line for each row other than the reference's."""
        return [f"**{self.setting}**", _table(self)]

    def lines(self) -> Iterator[dict[str, object]]:
        """Yield a line for each row."""
        for name, row in self.rows.items():
            changes = paired.to_mapping(row, self.changes.get(name, {}))
            yield {"place": self.setting, "reference": self.reference, "row": name, **changes}


def _names(frame: pd.DataFrame, keys: list[str]) -> pd.Series:
    """Return the name of each record: its system, and the values of keys in which records differ, unless usual."""
    names = as_text(frame["system"])
    for key in keys:
        values = as_text(frame[key])
        if values.nunique() > 1:
            names = names + (f", {key} " + values).where(~values.isin(usual(key)), "")
    return names


def _describe_change(measure: str, change: Difference) -> str:
    interval_text = interval(change)
    text = f"{HEADERS[measure]} {signed(change.mean)}" + (f" ({interval_text})" if interval_text else "")
    return f"{text}, beyond the noise" if change.beyond_noise else text


def _table(study: Comparison) -> str:
    has_metric = any(paired.METRIC in row.stats for row in study.rows.values())
    measures = [measure for measure in MEASURES if measure != paired.METRIC or has_metric]
    header = [f"Difference from {study.reference}"]
    for measure in measures:
        header += [HEADERS[measure], "95 %", "p (Holm)"]
    rule = ["---", *["---:"] * len(header)]
    lines = [
        [*header, "Pairs"],
        rule,
        *(_cells(name, changes, measures) for name, changes in study.changes.items()),
    ]
    return markdown_table(lines)


def _cells(name: str, changes: Mapping[str, Difference], measures: Sequence[str]) -> list[str]:
    cells = [name]
    for measure in measures:
        cells += _change(changes.get(measure))
    return [*cells, str(max((change.pairs for change in changes.values()), default=0))]


def _change(change: Difference | None) -> list[str]:
    """Return the difference, bold if it exceeds the noise, its interval and p."""
    if change is None:
        return [DASH] * 3
    mean = f"**{signed(change.mean)}**" if change.beyond_noise else signed(change.mean)
    return [mean, interval(change) or DASH, paired.p_value(change) or DASH]
