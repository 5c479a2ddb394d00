"""Report of a training as one HTML file: whether the result is better, how it was found, and where it fails."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from runners.config.escaping import counted, html_text
from runners.config.space import Space
from runners.reports.analysis.shared_worlds import WorstWorld
from runners.reports.explainer.write import document_parts, fill, write_html
from runners.reports.figures.style import picture
from runners.training.race import START, Race, racers
from runners.training.report_tables import (
    HeldOut,
    breakable,
    candidate_table,
    held_out_table,
    parameter_table,
    rounded,
    rung_table,
    worst_table,
)
from runners.training.study import Trial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SCRIPTS = ("theme.js", "training.js")
_STYLES = ("index.css", "training.css")
_PX_PER_IN = 125  # of a picture
_SIGNS = {1: "better", 0: "level", -1: "worse"}
_PAIRED_NOTE = " Differences are paired, world by world, with their 95 % intervals."
_RACE_NOTE = (
    "Every candidate drives the same worlds with the same random numbers, so differences are paired. Worse: dropped "
    "because the difference from the best is beyond the noise; outranked: because others were better."
)
_START_NOTE = " The start stays to the end."
_SCATTER_NOTE = (
    "A dot is a trial, with its mean reward in the search; those in colour entered the race. The ring is around the "
    "best trial, and the dashed line is the start."
)
_PLAIN_SCATTER_NOTE = (
    "A dot is a trial, with its mean reward. The ring is around the best one; dashed: the start."
)
_IMPORTANCE_NOTE = (
    "Importance (PED-ANOVA): share of a parameter in what sets the best tenth of the trials apart from all."
)


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """Content of the page.

    title, facts: its heading. sentence, sign: the verdict, and -1, 0 or 1. start: name of the starting weights.
    winner: number of the result's trial, or START. best: number of the best trial, even if the start won.
    training_reward, training_worlds: reward and worlds of the result in training. gap: this reward minus the mean of
    the held-out maps' rewards. held_out: the last row is of all maps. figures: "parameters", and "race" if there was
    one. regressions: number of episodes that fail where the start succeeded. commands: those that are useful next, by
    their purpose. files: files of the run to link.
    """

    title: str
    facts: str
    sentence: str
    sign: int
    start: str
    winner: int
    best: int
    training_reward: float
    training_worlds: str
    gap: float
    held_out: Sequence[HeldOut]
    figures: Mapping[str, Figure]
    race: Race | None
    trials: Sequence[Trial]
    space: Space
    start_values: Mapping[str, float | None]
    importances: Mapping[str, float]
    worst: Sequence[WorstWorld]
    failures: int
    regressions: int
    commands: Mapping[str, str]
    files: Sequence[Path]


def write_report(report: TrainingReport, path: Path) -> None:
    """Write the page. Links are relative to it. Raises InputError if it cannot be written."""
    document_fields = {
        **document_parts(report.title, _STYLES, _SCRIPTS),
        "TITLE": html_text(report.title),
        "FACTS": breakable(report.facts),
        "VERDICT": _verdict(report),
        "TILES": "".join(_tiles(report)),
        "HELDOUT": held_out_table(report.held_out, report.winner == START),
        "PAIRED": "" if report.winner == START else _PAIRED_NOTE,
        "RACE": _race(report),
        "PARAMETERS": _parameters(report),
        "WORST": _worst(report, path.parent),
        "COMMANDS": "".join(
            f"<dt>{html_text(purpose)}</dt><dd><code>{breakable(command)}</code></dd>"
            for purpose, command in report.commands.items()
        ),
        "FILES": ", ".join(f'<a href="{file.name}">{html_text(file.name)}</a>' for file in report.files),
    }
    write_html(path, fill("training.html", document_fields))


def _verdict(report: TrainingReport) -> str:
    word, _, explanation = report.sentence.partition(": ")
    return (
        f'<p class="verdict {_SIGNS[report.sign]}"><strong>{html_text(word)}</strong> '
        f"<span>{html_text(explanation[:1].upper() + explanation[1:])}.</span></p>"
    )


def _tiles(report: TrainingReport) -> Iterator[str]:
    """Yield the four most important facts as tiles."""
    overall = report.held_out[-1]
    is_start = report.winner == START
    yield _tile(
        "Success, held out",
        rounded(overall.success),
        "the start is the result" if is_start else f"start {rounded(overall.start_success)}",
    )
    yield _tile(
        "Reward, held out",
        rounded(overall.reward),
        "" if is_start else f"start {rounded(overall.start_reward)}",
    )
    gap = f"{rounded(abs(report.gap))} {'above' if report.gap >= 0.0 else 'below'} that of the held-out maps"
    yield _tile("Reward in training", rounded(report.training_reward), gap)
    winner_text = "the start" if is_start else f"trial {report.winner}"
    yield _tile(
        "SearchResult by", winner_text, f"of {counted(len(report.trials), 'trial')}, {report.training_worlds}"
    )


def _tile(name: str, value: str, caption: str) -> str:
    return f"<div><dt>{name}</dt><dd>{value}<small>{html_text(caption)}</small></dd></div>"


def _picture(figure: Figure, description: str) -> str:
    """Return a picture as an embedded image; inline, the page's content policy would refuse its styles."""
    data = b64encode(picture(figure, "svg")).decode("ascii")
    width = round(figure.get_figwidth() * _PX_PER_IN)
    return (
        f'<div class="wide" tabindex="0" role="region" aria-label="{description}">'
        f'<img alt="{description}" width="{width}" src="data:image/svg+xml;base64,{data}"></div>'
    )


def _race(report: TrainingReport) -> str:
    race = report.race
    if race is None:
        return "<p>There was no race: the best trial of the search is the result.</p>"
    raced = sum(racer.raced for racer in racers(race))
    start_note = _START_NOTE if START in race.rungs[0].values else ""
    chart = _picture(report.figures["race"], "Mean reward against the worlds driven, one line per candidate")
    return (
        f"{chart}<p>{_RACE_NOTE}{start_note}</p>{rung_table(race, report.start)}"
        f"<details><summary>{counted(raced, 'candidate')} that raced, rung by rung</summary>"
        f"{candidate_table(race, report.start)}</details>"
    )


def _parameters(report: TrainingReport) -> str:
    note = f"<p>{_IMPORTANCE_NOTE}</p>" if report.importances else ""
    values = next(trial.values for trial in report.trials if trial.number == report.best)
    name = f"Trial {report.best}"
    table = parameter_table(report.space, report.start_values, values, name, report.importances)
    panels = _picture(report.figures["parameters"], "Reward of every trial against each of its values")
    note_text = _SCATTER_NOTE if report.race is not None else _PLAIN_SCATTER_NOTE
    return f"{table}{note}<h3>Parameters against the reward</h3>{panels}<p>{note_text}</p>"


def _worst(report: TrainingReport, directory: Path) -> str:
    episodes = sum(row.worlds * row.runs for row in report.held_out[:-1])
    regressed = f", {report.regressions} of them where the start succeeded" if report.winner != START else ""
    sentence = (
        f"{report.failures} of {counted(episodes, 'episode')} failed{regressed if report.failures else ''}."
    )
    return f"<p>{sentence}</p>{worst_table(report.worst, directory)}"
