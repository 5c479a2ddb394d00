"""Search of a training, and the race of its best trials, which give its result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

from lme.errors import InputError
from runners.config import build, instantiate, systems
from runners.config.catalogue import Catalogue
from runners.config.changes import flatten
from runners.config.job import Job
from runners.config.schema import TrainConfig
from runners.config.space import Space, own_values, read_space
from runners.records.launch_record import identity
from runners.training.families import Families, training_worlds, with_worlds
from runners.training.held_out import Places, held_out_places
from runners.training.race import START, Candidate, Race, run_race
from runners.training.race_log import RACE_LOG, RaceLog
from runners.training.search import open_study, run_trials
from runners.training.study import CONFIGURATIONS, Study, Trial
from runners.workers import trials
from runners.workers.executor import Item, Map
from runners.workers.progress import RaceProgress, TrialProgress
from runners.workers.trials import Attempt, Place, Score


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Result of a training. number: that of the best trial, or START. values: by dotted config key; {} for START.

    configurations: worlds of the search. trials: the finished ones. num_elsewhere: number of trials that other machines
    still run. reward: mean over the worlds that the result drove. worlds: their number in each family.
    """

    space: Space
    configurations: list[int]
    trials: list[Trial]
    importances: dict[str, float]
    num_elsewhere: int
    race: Race | None
    number: int
    values: dict[str, float]
    reward: float
    worlds: int


def search_and_race(job: Job[TrainConfig], trained: Families) -> SearchResult:
    """Run the study until it has all its trials, then the race; trials and scores of an earlier run count."""
    config, run_dir = job.config, job.run_dir
    search = instantiate.build(config.search, "search")
    space = search_space(job)
    start = own_values(config, space) if config.start_from_config else None
    study_location = config.storage, config.study, run_dir
    # Open the study, and draw the worlds of the search and of each rung.
    study = open_study(*study_location, identity(config), space, search, start or {}, config.restarts)
    rungs = world_numbers(job, trained)
    check_configurations(study, trained, rungs[0], run_dir)
    stages = [[(name, world) for world in worlds for name in trained] for worlds in rungs]
    training = with_worlds(trained, [world for worlds in rungs for world in worlds])
    # Search and race with the same workers.
    with ExitStack() as workers:
        run_all = _started_when_needed(config, training, workers)
        with TrialProgress(f"train {config.robot.name}", config.trials) as progress:
            progress.skip(len(study.finished_trials), study.best)
            if study.num_finished < config.trials:
                run_trials(study, config.trials, search.batch, stages[0], run_all, progress.set_done)
        race = _race(job, study, stages, start, run_all) if config.race else None
    return _result(study, space, race, rungs, own_values(config, space))


def _started_when_needed(config: TrainConfig, training: Families, workers: ExitStack) -> Map:
    """Return a `map` that starts the workers when it is first called."""
    opened: list[Map] = []

    def run_all(batch: Any) -> Iterator[Item]:
        if not opened:
            executor = instantiate.build(config.executor, "executor")
            opened.append(workers.enter_context(executor.open(trials.initialise, training)))
        return opened[0](batch)

    return run_all


def _race(
    job: Job[TrainConfig],
    study: Study,
    stages: Sequence[Sequence[Place]],
    start: Mapping[str, float] | None,
    run_all: Map,
) -> Race:
    """Race the trials of the study and, if the search began from the config's own values, these: `start`."""
    config = job.config
    assert config.race is not None
    finished = [trial for trial in study.finished_trials if trial.values != start]
    candidates = [Candidate(trial.number, trial.values) for trial in finished]
    candidates += [Candidate(START, {})] if start is not None else []
    scores = [score for trial in finished for score in trial.scores]
    with RaceLog(job.run_dir / RACE_LOG) as log, RaceProgress() as progress:

        def drive(attempts: Sequence[Attempt]) -> Iterator[Score]:
            # Scores of an earlier run come from the log; only the others are driven.
            logged = {attempt: log.get(attempt) for attempt in attempts}
            progress.begin(len(attempts), len({attempt.trial for attempt in attempts}))
            for score in filter(None, logged.values()):
                progress.add()
                yield score
            for score in run_all([attempt for attempt, score in logged.items() if score is None]):
                log.add(score)
                progress.add()
                yield score

        return run_race(candidates, scores, stages, config.race, drive, config.restarts)


def _result(
    study: Study, space: Space, race: Race | None, rungs: Sequence[list[int]], start: Mapping[str, float]
) -> SearchResult:
    finished = study.finished_trials
    best_trial = max(finished, key=lambda trial: (trial.reward, -trial.number))
    number, reward = best_trial.number, best_trial.reward
    # The winner of the race replaces the best trial of the search.
    if race is not None:
        number, reward = race.winner, race.rungs[-1].values[race.winner]
    values = {trial.number: trial.values for trial in finished}.get(number, {})
    if values == start:  # the first trial, which has the values of the start
        number, values = START, {}
    num_worlds = sum(map(len, rungs))
    elsewhere = study.num_elsewhere
    return SearchResult(
        space, rungs[0], finished, study.importances(), elsewhere, race, number, values, reward, num_worlds
    )


def check_configurations(study: Study, trained: Families, worlds: list[int], run_dir: Path) -> None:
    """Store the worlds of the search in the study. Raises InputError if a map has changed since they were drawn."""
    configurations = []
    for name, family in trained.items():
        maps = build.map_set(family, worlds)
        for task in map(maps.task, worlds):
            configuration = {"world": task.number, "start": list(task.start), "goal": task.goal.tolist()}
            configurations.append(configuration if len(trained) == 1 else {"family": name, **configuration})
    stored = study.get_or_set(CONFIGURATIONS, configurations)
    if stored != configurations:
        first_changed = next(
            (
                drawn_configuration
                for stored_configuration, drawn_configuration in zip(stored, configurations, strict=False)
                if stored_configuration != drawn_configuration
            ),
            configurations[0],
        )
        name = first_changed.get("family", next(iter(trained)))
        raise InputError(
            f"{run_dir}: its study was trained on other configurations of map {name}, which has changed "
            "since: start another study"
        )


def start_name(job: Job[TrainConfig]) -> str:
    """Return the name of the training's start: the weight set, if the guide has one."""
    return job.weights if job.config.guide.get("parameters") else "the config's own values"


def search_space(job: Job[TrainConfig]) -> Space:
    """Return the search space: the ranges of the config, without the keys that the ablation fixes."""
    ablated = systems.ablation_settings(job.choices.get(systems.ABLATION, ""), Catalogue(job.folders))
    return read_space(job.config, dict(flatten(ablated)))


def evaluation_places(job: Job[TrainConfig], trained: Families) -> Places:
    """Return the maps that the result is evaluated on: `held_out`, or every family with its own worlds."""
    return held_out_places(job) if job.config.held_out else trained


def world_numbers(job: Job[TrainConfig], trained: Families) -> list[list[int]]:
    """Draw the numbers of the worlds of the search, and of each rung of the race. Raises InputError."""
    config = job.config
    counts = [config.configurations, *(config.race.worlds if config.race else [])]
    numbers = training_worlds(config, evaluation_places(job, trained).values(), sum(counts))
    with_worlds(trained, numbers)
    return [numbers[start:stop] for start, stop in pairwise([0, *accumulate(counts)])]
