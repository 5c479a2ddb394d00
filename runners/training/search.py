"""Search of a training: its study, opened or created and checked to be the same search; its trials; and their race.

The race of the best trials gives the result.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from runners.config import build, instantiate, systems
from runners.config.catalogue import Catalogue
from runners.config.changes import flatten
from runners.config.escaping import masked
from runners.config.job import Job
from runners.config.schema import TrainConfig
from runners.config.space import Space, own_values, read_space
from runners.records import launch_record
from runners.records.launch_record import identity
from runners.training.families import Families, training_worlds, with_worlds
from runners.training.held_out import Places, held_out_places
from runners.training.optuna_private import is_first
from runners.training.race import START, Candidate, Race, run_race
from runners.training.race_log import RACE_LOG, SCORE_LOG, RaceLog, ScoreLog
from runners.training.samplers import Search, per_trial
from runners.training.storage import Heartbeat, open_storage, storage_errors
from runners.training.study import CONFIGURATIONS, Proposal, Study, Trial
from runners.workers import trials
from runners.workers.executor import Item, Map
from runners.workers.progress import RaceProgress, TrialProgress, activity
from runners.workers.trials import Attempt, Place, Score

if TYPE_CHECKING:
    import optuna
    from optuna.storages import BaseStorage


JOURNAL = "study.journal"
_IDENTITY = "identity"
_POLL_S = 1.0  # [s] between checks of the trials of other processes
# Keys that do not identify a study: they set the length of the search, and the use of its result.
_NOT_SEARCHED = ("trials", "runs", "held_out", "name", "storage", "study")


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
    with activity("Opening the study"):
        study = open_study(*study_location, identity(config), space, search, start or {}, config.restarts)
        rungs = world_numbers(job, trained)
        check_configurations(study, trained, rungs[0], run_dir)
    stages = [[(name, world) for world in worlds for name in trained] for worlds in rungs]
    training = with_worlds(trained, [world for worlds in rungs for world in worlds])
    # Search and race with the same workers.
    with ExitStack() as workers:
        run_all = _started_when_needed(config, training, workers)
        with TrialProgress(f"train {config.robot.name}", config.trials) as progress:
            progress.skip(study.num_finished, study.best)
            if study.num_finished < config.trials:

                def run_counted(batch: Iterable[Item]) -> Iterator[Item]:
                    for score in run_all(batch):
                        progress.add_episode()
                        yield score

                run_trials(study, config.trials, search.batch, stages[0], run_counted, progress.set_done)
        race = _race(job, study, stages, start, run_all) if config.race else None
    with activity("Importances of the parameters"):
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
    scores = (score for trial in finished for score in trial.scores)
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


def open_study(
    storage: str | None,
    name: str | None,
    run_dir: Path,
    identity: Mapping[str, Any],
    space: Space,
    search: Search,
    start_values: Mapping[str, float],
    restarts: int = 1,
) -> Study:
    """Open the study of a run, or create it.

    storage, name: as in the config. identity: that of the config. start_values: values of the first trial; the search
    chooses the others. restarts: number of searches, among which the trials alternate. Raises InputError if the
    storage cannot be used, or has a study of this name with another robot, map, search space or seed.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    searched = {key: value for key, value in identity.items() if key not in _NOT_SEARCHED}
    name = name or f"lme-{launch_record.fingerprint([searched], multirun=False)[:8]}"
    # Open the study; the first process stores the identity of its search.
    sampler = per_trial(search.sampler, identity["seed"], start_values, restarts)
    with storage_errors(storage, "start again when it does"):
        study = _open(storage, name, run_dir, space, sampler)
        stored = study.get_or_set(_IDENTITY, searched)
    # A study of another search must not be continued.
    damaged = [] if isinstance(stored, Mapping) else [f"{_IDENTITY} is {stored!r:.40}: must be a mapping"]
    conflicts = damaged or list(launch_record.differences(stored, searched))
    if conflicts:
        study_name = run_dir / JOURNAL if storage is None else f"study {name} in {masked(storage)}"
        raise InputError(
            f"{study_name}: belongs to another search ({launch_record.shortened(conflicts)}): "
            "choose another study=NAME or directory"
        )
    return study


def _open(
    storage: str | None, name: str, run_dir: Path, space: Space, sampler: optuna.samplers.BaseSampler
) -> Study:
    from optuna.storages import RDBStorage

    if storage is None:
        return _open_journal(run_dir / JOURNAL, name, space, sampler)
    shared = open_storage(storage)
    owner = f"{socket.gethostname()}:{run_dir.resolve()}"
    heartbeat = Heartbeat(shared if isinstance(shared, RDBStorage) else None)
    log = ScoreLog(run_dir / SCORE_LOG)
    # A database needs no flush.
    return Study(_create(shared, name, sampler), space, owner, lambda: None, heartbeat, log)


def _create(storage: BaseStorage, name: str, sampler: optuna.samplers.BaseSampler) -> optuna.Study:
    import optuna

    return optuna.create_study(
        study_name=name,
        storage=storage,
        sampler=sampler,
        pruner=optuna.pruners.NopPruner(),
        direction="maximize",
        load_if_exists=True,
    )


def _open_journal(path: Path, name: str, space: Space, sampler: optuna.samplers.BaseSampler) -> Study:
    """Open the study in a journal. Raises InputError if it is damaged."""
    from optuna.storages import JournalStorage

    from runners.training.journal import Journal

    journal = Journal(path)
    try:
        created = _create(JournalStorage(journal), name, sampler)
        if not is_first(created):
            raise ValueError("the first study was deleted")
        study = Study(created, space, "", journal.flush, Heartbeat(None), ScoreLog(None))
        _ = study.finished_trials  # raises unless every trial can be read
    except Exception as error:  # JSON that does not describe steps of a study can raise anything
        raise InputError(
            f"{path}: is damaged ({type(error).__name__}): restore the file, or start another study"
        ) from error
    return study


def run_trials(
    study: Study,
    total: int,
    batch: int,
    configurations: Sequence[Place],
    run_all: Map,
    note: Callable[[int, float | None], None],
) -> None:
    """Run trials until the study has `total`, starting with the unfinished ones of a killed run.

    If other processes run the last trials, wait for them, and take over those of a process that dies.
    configurations: families and worlds that every trial drives. run_all: maps attempts to scores, in any order. note:
    called with the number of finished trials and the best reward so far.
    """
    with study.keep_alive():
        while study.num_finished < total:
            # Claim and run a batch, and report it in the order of the numbers, which the sampler depends on.
            if proposals := study.claim(total, batch):
                _run_batch(study, proposals, configurations, run_all)
                for proposal in proposals:
                    study.tell(proposal.number)
                    note(study.num_finished, study.best)
            # Other processes run the rest: wait, as one of them may die.
            elif study.finds_killed:
                time.sleep(_POLL_S)
                note(study.num_finished, study.best)
            else:
                break


def _run_batch(study: Study, batch: list[Proposal], configurations: Sequence[Place], run_all: Map) -> None:
    """Run all episodes of a batch. The scores of a trial are stored when its last episode ends."""
    unscored = [proposal for proposal in batch if not study.scored(proposal.number)]
    attempts = [
        Attempt(proposal.number, *configuration, tuple(proposal.values.items()))
        for proposal in unscored
        for configuration in configurations
    ]
    scores: dict[int, dict[Place, Score]] = {proposal.number: {} for proposal in unscored}
    for score in run_all(attempts):
        of_trial = scores[score.trial]
        of_trial[score.place] = score
        if len(of_trial) == len(configurations):
            study.store_scores(score.trial, [of_trial[configuration] for configuration in configurations])
