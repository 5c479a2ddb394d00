"""Report of a training from its records: two pictures, pages of the worst held-out worlds, and report.html."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config import instantiate
from runners.config.flatten import flatten
from runners.config.job import Job
from runners.config.quoting import lme_command, resume_command
from runners.config.schema import TrainConfig
from runners.config.space import Space
from runners.records.launch_record import trust_flags
from runners.reports.analysis.failures import is_failure, page_path
from runners.reports.analysis.shared_worlds import WorstWorld, regressions, worst_worlds
from runners.reports.explainer import pages
from runners.reports.figures.style import save
from runners.training.families import families
from runners.training.held_out import Places, write_table
from runners.training.race import START
from runners.training.report_page import TrainingReport, write_report
from runners.training.report_tables import HeldOut
from runners.training.search_and_race import Found, start_name
from runners.training.verdict import HeldOutComparison, Verdict

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


def write_training_report(
    job: Job[TrainConfig],
    places: Places,
    found: Found,
    start: pd.DataFrame,
    frame: pd.DataFrame,
    verdict: Verdict,
    use: str,
    start_dir: Path,
) -> list[Path]:
    """Write everything, print the path of the page, and return the paths of the pictures and of the page.

    places: held-out configs by map. start, frame: records of the start and of the result, with rewards; the same if
    the start won. use: command that drives with the weights. start_dir: directory of the start's evaluation.
    """
    run_dir, is_start = job.run_dir, found.number == START
    start_values = _start_values(job.config, found.space)
    best = found.race.best_trial if found.race is not None else found.number
    if best == START:  # the best trial has the values of the start, or there is no other
        best = max(found.told, key=lambda trial: (trial.reward, -trial.number)).number
    # Pictures, and explainer pages of the worst worlds.
    figures = _figures(found, start_values, start_name(job), best)
    pictures = [path for name, figure in figures.items() for path in save(figure, run_dir / name)]
    worst = worst_worlds(frame, None if is_start else start, _WORST)
    _explain(job, frame, worst)
    # The page, with links to files and commands.
    report = TrainingReport(
        title=f"Training of {start['system'].iloc[0]} on {job.config.robot.name}",
        facts=_facts(job, len(found.told)),
        sentence=verdict.lines(start_name(job))[-1],
        sign=verdict.sign,
        start=start_name(job),
        winner=found.number,
        best=best,
        training_reward=found.reward,
        training_worlds=f"{found.worlds} worlds{' of each family' if not job.config.map else ''}",
        gap=verdict.gap,
        held_out=_held_out(verdict),
        figures=figures,
        race=found.race,
        trials=found.told,
        space=found.space,
        start_values=start_values,
        importances=found.importances,
        worst=worst,
        failures=int(is_failure(frame).sum()),
        regressions=0 if is_start else regressions(frame, start),
        commands=_commands(job, places, found, verdict, use, start_dir, worst[0]),
        files=[run_dir / name for name in _FILES if (run_dir / name).is_file()],
    )
    path = run_dir / REPORT
    write_report(report, path)
    print(f"Report: {path}")
    return [*pictures, path]


def _start_values(config: TrainConfig, space: Space) -> dict[str, float | None]:
    known: dict[str, Any] = dict(flatten(asdict(config)))
    return {key: None if known[key] is None else float(known[key]) for key in space}


def _figures(
    found: Found, start_values: Mapping[str, float | None], start: str, best: int
) -> dict[str, Figure]:
    """Draw the page's pictures, by the names of their files. start: its name. best: number of the best trial."""
    from runners.training.pictures import parameters_figure, race_figure

    race = found.race
    raced = frozenset(race.rungs[1].values) if race is not None else frozenset[int]()  # of the first rung
    parameters = parameters_figure(found.told, found.space, best, start_values, raced)
    return {"parameters": parameters, **({"race": race_figure(race, start)} if race is not None else {})}


def _explain(job: Job[TrainConfig], frame: pd.DataFrame, worst: Sequence[WorstWorld]) -> None:
    """Make the explainer pages of these worlds; existing pages are kept."""
    executor, made = instantiate.build(job.config.executor, "executor"), list[pages.Page]()
    for run_dir in dict.fromkeys(world.run_dir for world in worst):
        keys = {world.key for world in worst if world.run_dir == run_dir}
        here = frame[frame["run_dir"] == str(run_dir)]
        chosen = here[[key in keys for key in pages.keys_of(here)]]
        where = {key: page_path(run_dir, key) for key in keys}
        made += pages.make_pages(run_dir, chosen, where, executor, keep=True)
        pages.index(run_dir)
        write_table(job, run_dir)  # again, since the table lists the pages
    missing = [page for page in made if page.problem]
    if missing:
        warnings.warn(
            f"{len(missing)} of {len(made)} pages were not made: {missing[0].problem}", stacklevel=2
        )


def _facts(job: Job[TrainConfig], trials: int) -> str:
    config = job.config
    trained = families(config, job.choices)
    where = ", ".join(f"{name} ({family.robot.name})" for name, family in trained.items())
    start = f"start: {start_name(job)}{'' if config.start_from_config else ', not a candidate'}"
    return f"{trials} trials ({job.choices['search']}, seed {config.seed}) · {where} · {start}"


def _held_out(verdict: Verdict) -> list[HeldOut]:
    """Return one row per map, and one of all worlds, in which every world counts the same."""
    return [_row(place, each) for place, each in {**verdict.by_place, "all": verdict.overall}.items()]


def _row(place: str, each: HeldOutComparison) -> HeldOut:
    success, reward = each.success_difference, each.reward_difference
    return HeldOut(
        place,
        success.worlds,
        success.pairs // success.worlds,
        each.success,
        each.success - success.mean,
        success,
        each.reward,
        each.reward - reward.mean,
        reward,
    )


def _commands(
    job: Job[TrainConfig],
    places: Places,
    found: Found,
    verdict: Verdict,
    use: str,
    start_dir: Path,
    worst: WorstWorld,
) -> dict[str, str]:
    """Return the commands that are useful next, by their purpose."""
    run_dir = job.run_dir
    words = {}
    if found.number != START:
        not_advised = " (not recommended)" if verdict.is_worse else ""
        words[f"Drive with the result{not_advised}"] = use
        for place in places:
            both = lme_command("compare", start_dir / place, run_dir / place)
            words[f"Compare with the start on {place}, world by world"] = both
    if worst.failed:
        why = lme_command("explain", worst.run_dir, "failures", *trust_flags(worst.run_dir))
        words[f"See why the robot failed on {worst.run_dir.name}"] = why
    words["Continue this training, if it was stopped"] = resume_command("train", run_dir)
    return words
