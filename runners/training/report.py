"""Report of a training from its records: two pictures, pages of the worst held-out worlds, and report.html."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config import instantiate
from runners.config.changes import flatten
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
from runners.training.search_and_race import SearchResult, start_name
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
    start_values = _start_values(job.config, search_result.space)
    best = search_result.race.best_trial if search_result.race is not None else search_result.number
    if best == START:  # the best trial has the values of the start, or there is no other
        best = max(search_result.trials, key=lambda trial: (trial.reward, -trial.number)).number
    # Pictures, and explainer pages of the worst worlds.
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
        held_out=_held_out(verdict),
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
    write_report(report, path)
    print(f"Report: {path}")
    return [*pictures, path]


def _start_values(config: TrainConfig, space: Space) -> dict[str, float | None]:
    config_values: dict[str, Any] = dict(flatten(asdict(config)))
    return {key: None if config_values[key] is None else float(config_values[key]) for key in space}


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
    failed_pages = [page for page in all_pages if page.problem]
    if failed_pages:
        warnings.warn(
            f"{len(failed_pages)} of {len(all_pages)} pages were not made: {failed_pages[0].problem}",
            stacklevel=2,
        )


def _facts(job: Job[TrainConfig], trials: int) -> str:
    config = job.config
    trained = families(config, job.choices)
    families_text = ", ".join(f"{name} ({family.robot.name})" for name, family in trained.items())
    start = f"start: {start_name(job)}{'' if config.start_from_config else ', not a candidate'}"
    return f"{trials} trials ({job.choices['search']}, seed {config.seed}) · {families_text} · {start}"


def _held_out(verdict: Verdict) -> list[HeldOut]:
    """Return one row per map, and one of all worlds, in which every world counts the same."""
    return [
        _row(map_name, comparison)
        for map_name, comparison in {**verdict.by_place, "all": verdict.overall}.items()
    ]


def _row(map_name: str, comparison: HeldOutComparison) -> HeldOut:
    success, reward = comparison.success_difference, comparison.reward_difference
    return HeldOut(
        map_name,
        success.worlds,
        success.pairs // success.worlds,
        comparison.success,
        comparison.success - success.mean,
        success,
        comparison.reward,
        comparison.reward - reward.mean,
        reward,
    )


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
