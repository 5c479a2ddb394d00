"""Report of a training as one HTML file: whether the result is better, how it was found, and where it fails.

With it come two pictures, and explainer pages of the worst held-out worlds.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config import instantiate
from runners.config.changes import flatten
from runners.config.escaping import counted, html_text
from runners.config.job import Job
from runners.config.quoting import lme_command, resume_command
from runners.config.schema import TrainConfig
from runners.config.space import Space
from runners.records.launch_record import trust_flags
from runners.reports.analysis.failures import is_failure, page_path
from runners.reports.explainer import pages
from runners.reports.explainer.write import document_parts, fill, write_html
from runners.reports.figures.style import picture, save
from runners.training.families import families
from runners.training.held_out import VERDICTS, HeldOutComparison, Places, Verdict, write_table
from runners.training.race import START, Race, racers
from runners.training.report_tables import (
    WorstWorld,
    breakable,
    candidate_table,
    held_out_table,
    parameter_table,
    regressions,
    rounded,
    rung_table,
    worst_table,
    worst_worlds,
)
from runners.training.search import SearchResult, start_name
from runners.training.study import Trial
from runners.workers.progress import activity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


REPORT = "report.html"
_WORST = 6  # worlds that get an explainer page
_FILES = (
    "weights.yaml",
    "table.md",
    "trials.csv",
    "race.png",
    "parameters.png",
    "convergence.png",
    "importance.png",
)
_SCRIPTS = ("theme.js", "training.js")
_STYLES = ("index.css", "training.css")
_PX_PER_IN = 125  # of a picture
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


def write_training_report(
    job: Job[TrainConfig],
    held_out: Places,
    search_result: SearchResult,
    start: pd.DataFrame,
    frame: pd.DataFrame,
    verdict: Verdict,
    command: str,
    start_dir: Path,
) -> list[Path]:
    """Write everything, print the path of the page, and return the paths of the pictures and of the page.

    held_out: held-out configs by map. start, frame: records of the start and of the result, with rewards; the same if
    the start won. command: the one that drives with the weights. start_dir: directory of the start's evaluation.
    """
    run_dir, is_start = job.run_dir, search_result.number == START
    config_values: dict[str, Any] = dict(flatten(asdict(job.config)))
    start_values = {
        key: None if config_values[key] is None else float(config_values[key]) for key in search_result.space
    }
    best = search_result.race.best_trial if search_result.race is not None else search_result.number
    if best == START:  # the best trial has the values of the start, or there is no other
        best = max(search_result.trials, key=lambda trial: (trial.reward, -trial.number)).number
    # Pictures, and explainer pages of the worst worlds.
    with activity("Pictures of the report"):
        figures = _figures(search_result, start_values, start_name(job), best)
        pictures = [path for name, figure in figures.items() for path in save(figure, run_dir / name)]
    worst_worlds_found = worst_worlds(frame, None if is_start else start, _WORST)
    _explain(job, frame, worst_worlds_found)
    # The page, with links to files and commands.
    report = TrainingReport(
        title=f"Training of {start['system'].iloc[0]} on {job.config.robot.name}",
        facts=_facts(job, len(search_result.trials)),
        sentence=verdict.lines(start_name(job))[-1],
        sign=verdict.sign,
        start=start_name(job),
        winner=search_result.number,
        best=best,
        training_reward=search_result.reward,
        training_worlds=f"{search_result.worlds} worlds{' of each family' if not job.config.map else ''}",
        gap=verdict.gap,
        held_out={**verdict.by_place, "all": verdict.overall},
        figures=figures,
        race=search_result.race,
        trials=search_result.trials,
        space=search_result.space,
        start_values=start_values,
        importances=search_result.importances,
        worst=worst_worlds_found,
        failures=int(is_failure(frame).sum()),
        regressions=0 if is_start else regressions(frame, start),
        commands=_commands(job, held_out, search_result, verdict, command, start_dir, worst_worlds_found[0]),
        files=[run_dir / name for name in _FILES if (run_dir / name).is_file()],
    )
    path = run_dir / REPORT
    with activity("Report"):
        write_report(report, path)
    print(f"Report: {path}")
    return [*pictures, path]


def _figures(
    search_result: SearchResult, start_values: Mapping[str, float | None], start: str, best: int
) -> dict[str, Figure]:
    """Draw the page's pictures, by the names of their files. start: its name. best: number of the best trial."""
    from runners.training.pictures import parameters_figure, race_figure

    race = search_result.race
    raced = frozenset(race.rungs[1].values) if race is not None else frozenset[int]()  # of the first rung
    parameters = parameters_figure(search_result.trials, search_result.space, best, start_values, raced)
    return {"parameters": parameters, **({"race": race_figure(race, start)} if race is not None else {})}


def _explain(job: Job[TrainConfig], frame: pd.DataFrame, worst: Sequence[WorstWorld]) -> None:
    """Make the explainer pages of these worlds; existing pages are kept."""
    executor, all_pages = instantiate.build(job.config.executor, "executor"), list[pages.Page]()
    for run_dir in dict.fromkeys(world.run_dir for world in worst):
        keys = {world.key for world in worst if world.run_dir == run_dir}
        episodes_of_run = frame[frame["run_dir"] == str(run_dir)]
        episodes = episodes_of_run[[key in keys for key in pages.keys_of(episodes_of_run)]]
        page_paths = {key: page_path(run_dir, key) for key in keys}
        all_pages += pages.make_pages(run_dir, episodes, page_paths, executor, keep=True)
        pages.index(run_dir)
        write_table(job, run_dir)  # again, since the table lists the pages
    pages.warn_of_problems(all_pages)


def _facts(job: Job[TrainConfig], trials: int) -> str:
    config = job.config
    trained = families(config, job.choices)
    families_text = ", ".join(f"{name} ({family.robot.name})" for name, family in trained.items())
    start = f"start: {start_name(job)}{'' if config.start_from_config else ', not a candidate'}"
    return f"{trials} trials ({job.choices['search']}, seed {config.seed}) · {families_text} · {start}"


def _commands(
    job: Job[TrainConfig],
    held_out: Places,
    search_result: SearchResult,
    verdict: Verdict,
    command: str,
    start_dir: Path,
    worst_world: WorstWorld,
) -> dict[str, str]:
    """Return the commands that are useful next, by their purpose."""
    run_dir = job.run_dir
    words = {}
    if search_result.number != START:
        not_advised = " (not recommended)" if verdict.is_worse else ""
        words[f"Drive with the result{not_advised}"] = command
        for map_name in held_out:
            compare_command = lme_command("compare", start_dir / map_name, run_dir / map_name)
            words[f"Compare with the start on {map_name}, world by world"] = compare_command
    if worst_world.failed:
        explain_command = lme_command(
            "explain", worst_world.run_dir, "failures", *trust_flags(worst_world.run_dir)
        )
        words[f"See why the robot failed on {worst_world.run_dir.name}"] = explain_command
    words["Continue this training, if it was stopped"] = resume_command("train", run_dir)
    return words


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """Content of the page.

    title, facts: its heading. sentence, sign: the verdict, and -1, 0 or 1. start: name of the starting weights. winner:
    number of the result's trial, or START. best: number of the best trial, even if the start won. training_reward,
    training_worlds: reward and worlds of the result in training. gap: this reward minus the mean of the held-out maps'
    rewards. held_out: by map, and "all", in which every world counts the same. figures: "parameters", and "race" if
    there was one. regressions: number of episodes that fail where the start succeeded. commands: those that are useful
    next, by their purpose. files: files of the run to link.
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
    held_out: Mapping[str, HeldOutComparison]
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
        f'<p class="verdict {VERDICTS[report.sign]}"><strong>{html_text(word)}</strong> '
        f"<span>{html_text(explanation[:1].upper() + explanation[1:])}.</span></p>"
    )


def _tiles(report: TrainingReport) -> Iterator[str]:
    """Yield the four most important facts as tiles."""
    overall = report.held_out["all"]
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
        "Result by", winner_text, f"of {counted(len(report.trials), 'trial')}, {report.training_worlds}"
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
    sample_note = _sample_note(len(race.rungs[0].values), "raced")
    chart = _picture(report.figures["race"], "Mean reward against the worlds driven, one line per candidate")
    return (
        f"{chart}<p>{_RACE_NOTE}{start_note}{sample_note}</p>{rung_table(race, report.start)}"
        f"<details><summary>{counted(raced, 'candidate')} that raced, rung by rung</summary>"
        f"{candidate_table(race, report.start)}</details>"
    )


def _parameters(report: TrainingReport) -> str:
    note = f"<p>{_IMPORTANCE_NOTE}</p>" if report.importances else ""
    values = next(trial.values for trial in report.trials if trial.number == report.best)
    name = f"Trial {report.best}"
    table = parameter_table(report.space, report.start_values, values, name, report.importances)
    panels = _picture(report.figures["parameters"], "Reward of every trial against each of its values")
    note_text, besides = _PLAIN_SCATTER_NOTE, "was the best so far"
    if report.race is not None:
        note_text, besides = _SCATTER_NOTE, f"raced or {besides}"
    sample_note = _sample_note(len(report.trials), besides)
    return f"{table}{note}<h3>Parameters against the reward</h3>{panels}<p>{note_text}{sample_note}</p>"


def _sample_note(count: int, besides: str) -> str:
    """Return what a picture leaves out of a very long search; empty if it shows all of the `count`."""
    from runners.training.pictures import one_drawn_in

    step = one_drawn_in(count)
    if step == 1:
        return ""
    return f" Of {count:,}, the picture shows one in {step}, and each that {besides}; trials.csv has all."


def _worst(report: TrainingReport, directory: Path) -> str:
    maps = (comparison for name, comparison in report.held_out.items() if name != "all")
    episodes = sum(comparison.worlds * comparison.runs for comparison in maps)
    regressed = f", {report.regressions} of them where the start succeeded" if report.winner != START else ""
    sentence = (
        f"{report.failures} of {counted(episodes, 'episode')} failed{regressed if report.failures else ''}."
    )
    return f"<p>{sentence}</p>{worst_table(report.worst, directory)}"
