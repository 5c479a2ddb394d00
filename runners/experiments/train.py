"""Train one composed config: a search for parameters, their weight file, and how they do where they never were."""

from __future__ import annotations

import contextlib
import dataclasses
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from lme.errors import InputError, require
from lme.worlds.world import MapSet
from runners.analysis import failures
from runners.config import build
from runners.config.instantiate import build as build_target
from runners.config.schema import EvalConfig
from runners.config.space import PARAMETERS, Space, own_values, read_space, with_values
from runners.experiments import evaluate
from runners.records import run_directories, weight_file
from runners.records.append_log import lock
from runners.search import study
from runners.search.study import Proposal, Study, Trial
from runners.workers import trials
from runners.workers.executor import Map
from runners.workers.progress import TrialProgress

if TYPE_CHECKING:
    import pandas as pd

_TRAINING = 0x7472  # keeps the stream that configurations are drawn from apart from those of the episodes


def validate(config: DictConfig) -> None:
    """Build what is cheap to build and check the rest, so that mistakes show before anything runs."""
    build.validate(config)
    plain = build.plain(config)
    for key in ("trials", "configurations"):
        require(key, plain[key], at_least=1)
    for key in ("crash", "timeout"):
        require(f"reward.{key}", plain["reward"][key], at_most=0.0)
    if plain["reward"]["max_steps"] is not None:
        require("reward.max_steps", plain["reward"]["max_steps"], at_least=1)
    read_space(plain)
    build_target(plain["search"], "search")
    training_maps(plain, training_worlds(plain))
    weight_file.check_name(_name(config), _fingerprint(config))
    if plain["storage"] is not None:
        study.open_storage(plain["storage"])


def train(config: DictConfig, run_dir: Path) -> None:
    """Search until the study has its trials, evaluate the best, and write everything below `run_dir`."""
    plain = build.plain(config)
    tracking = build_target(plain["tracking"], "tracking")
    tags = {**evaluate.record_names(plain), "weights": _name(config), "command": "train"}
    tracking.start(_without_password(plain), run_dir, tags, evaluate.sweep_directory())
    try:
        with _held(run_dir):
            found = _search(config, plain, run_dir)
            best = max(found.told, key=lambda trial: (trial.reward, -trial.number))
            weights = _write_weights(config, plain, found, best, run_dir)
            pictures = _pictures(found, read_space(plain), run_dir)
            frame = _held_out(plain, best, run_dir, _name(config))
    except KeyboardInterrupt:
        print(f"\nStopped. Go on with: lme train resume={run_dir}", file=sys.stderr)
        raise
    pages = [page for place in frame["run_dir"].unique() for page in failures.folder(Path(place))]
    _book(tracking, found.told, best, frame, [weights, *pictures, *pages])


def training_worlds(plain: Mapping[str, Any]) -> list[int]:
    """Numbers of the configurations to train on: drawn once per seed, and none that is held out.

    Raises InputError where there are too few to draw from.
    """
    numbers, count = list(plain["training_numbers"]), plain["configurations"]
    if len(numbers) != 2 or not 0 <= numbers[0] <= numbers[1]:
        raise InputError(f"training_numbers is {numbers}: must be [first, last], from 0 on")
    first, last = numbers
    nodes = list(plain["held_out"].values()) or [plain["map"]]
    kept = {number for node in nodes for number in build.map_set({**plain, "map": node}).numbers}
    left = last - first + 1 - sum(first <= number <= last for number in kept)
    if left < count:
        raise InputError(
            f"training_numbers is {numbers}: must leave {count} worlds beside those held out, and leaves {left}"
        )
    rng = np.random.default_rng(np.random.SeedSequence([plain["seed"], _TRAINING]))
    drawn: list[int] = []
    while len(drawn) < count:
        number = int(rng.integers(first, last + 1))
        if number not in kept and number not in drawn:
            drawn.append(number)
    return drawn


def training_maps(plain: Mapping[str, Any], worlds: list[int]) -> MapSet:
    """The map set with these worlds. Raises InputError where it does not have them."""
    try:
        return build.map_set(with_values(plain, {"map.worlds": worlds}))
    except InputError as error:
        raise InputError(
            f"training_numbers is {list(plain['training_numbers'])}: must be worlds that the map has, such as "
            f"[0,199] beside map=barn's hard100 ({error})"
        ) from error


def _search(config: DictConfig, plain: dict[str, Any], run_dir: Path) -> Study:
    """All trials of the study, those of an earlier run included."""
    identity = run_directories.identity(config)
    search = build_target(plain["search"], "search")
    space = read_space(plain)
    first = own_values(plain, space) if plain["start_from_config"] else {}
    opened = study.open_study(plain["storage"], plain["study"], run_dir, identity, space, search, first)
    worlds = _settled_worlds(opened, plain, run_dir)
    training = with_values(plain, {"map.worlds": worlds})
    with TrialProgress(f"train {plain['robot']['name']}", plain["trials"]) as progress:
        progress.skip(len(opened.told), opened.best)
        if opened.room(plain["trials"], search.batch):
            executor = build_target(plain["executor"], "executor")
            with executor.open(trials.initialise, training, len(worlds) * search.batch) as run_all:
                run_trials(opened, plain["trials"], search.batch, worlds, run_all, progress.add)
    return opened


def run_trials(
    opened: Study,
    total: int,
    batch: int,
    worlds: list[int],
    run_all: Map,
    note: Callable[[float | None], None],
) -> None:
    """Bring a study to `total` trials, beginning with those that a killed run left.

    run_all: attempts to scores, in any order. note: called after each trial with the best reward so far.
    """
    while count := opened.room(total, batch):
        proposals = opened.unfinished() or opened.ask(count)
        _run_batch(opened, proposals, worlds, run_all)
        for proposal in proposals:
            opened.tell(proposal.number)
            note(opened.best)


def _run_batch(opened: Study, batch: list[Proposal], worlds: list[int], run_all: Map) -> None:
    """Every episode of a batch; a trial is kept as soon as its last one ends."""
    todo = [proposal for proposal in batch if not opened.scored(proposal.number)]
    attempts = [
        trials.Attempt(proposal.number, world, tuple(proposal.values.items()))
        for proposal in todo
        for world in worlds
    ]
    scores: dict[int, list[trials.Score]] = {proposal.number: [] for proposal in todo}
    for score in run_all(attempts):
        of_trial = scores[score.trial]
        of_trial.append(score)
        if len(of_trial) == len(worlds):
            opened.keep(score.trial, sorted(of_trial, key=lambda score: worlds.index(score.world)))


def _settled_worlds(opened: Study, plain: dict[str, Any], run_dir: Path) -> list[int]:
    """The study's own configurations. Raises InputError where the map has changed since they were drawn."""
    worlds = training_worlds(plain)
    maps = training_maps(plain, worlds)
    drawn = []
    for task in map(maps.task, worlds):
        drawn.append({"world": task.number, "start": list(task.start), "goal": task.goal.tolist()})
    kept = opened.settle(study.CONFIGURATIONS, drawn)
    if kept != drawn:
        raise InputError(
            f"{run_dir}: its study was trained on other configurations of map {task.map_name}, which has changed "
            "since: start another study"
        )
    return worlds


def _write_weights(
    config: DictConfig, plain: dict[str, Any], found: Study, best: Trial, run_dir: Path
) -> Path:
    told, name = found.told, _name(config)
    about = {
        "map": _choice("map"),
        "configurations": training_worlds(plain),
        "search": _choice("search"),
        "trials": len(told),
        "trial": best.number,
        "reward": best.reward,
        "study": _fingerprint(config),
    }
    use = weight_file.usage(
        plain, best.values, {group: _choice(group) for group in ("guide", "planner")}, name
    )
    path = weight_file.write_weights(plain, best.values, about, run_dir, name, use)
    print(f"Best of {len(told)} trials: reward {best.reward:.3f} (trial {best.number})")
    for key, value in best.values.items():
        print(f"  {key.removeprefix(PARAMETERS)} = {value:.4g}")
    if found.num_elsewhere:
        print(f"{found.num_elsewhere} trials are still running on other machines and do not count")
    print(f"Weights: {path}; use them with: {use}")
    return path


def _pictures(found: Study, space: Space, run_dir: Path) -> list[Path]:
    from runners.figures.reports.training import training_figures, write_trials

    told = found.told
    return [write_trials(told, run_dir), *training_figures(told, space, found.importances(), run_dir)]


def _held_out(plain: dict[str, Any], best: Trial, run_dir: Path, name: str) -> pd.DataFrame:
    """Evaluate on worlds that training never saw, and print how it went."""
    from runners.analysis.tables import print_table, write_tables
    from runners.records.records import read_episodes

    places = plain["held_out"] or {_choice("map"): plain["map"]}
    for place, maps in places.items():
        worlds = build.map_set({**plain, "map": maps}).numbers
        print(f"Now {len(worlds)} worlds of {place} that training never saw, {plain['runs']} runs each")
        _evaluate_on(plain, best, place, maps, run_dir, name)
    frame = read_episodes([run_dir / place for place in places])
    write_tables(frame, run_dir)
    print_table(frame)
    print(f"Study, weights, pictures, records and tables: {run_dir}")
    return frame


def _evaluate_on(
    plain: dict[str, Any], best: Trial, place: str, maps: dict[str, Any], run_dir: Path, name: str
) -> None:
    """An evaluation's directory below the training run's."""
    fields = {field.name for field in dataclasses.fields(EvalConfig)}
    base = {key: value for key, value in with_values(plain, best.values).items() if key in fields}
    config = {**base, "map": maps, "weights": name, "resume": False}
    directory = run_dir / place
    directory.mkdir(exist_ok=True)
    own = run_directories.identity(DictConfig(config))
    fingerprint = run_directories.fingerprint([own], multirun=False)
    run_directories.Launch("eval", fingerprint, False, [], [own]).write(directory)
    names = {**evaluate.record_names(config), "map": place}
    if not all(
        key.startswith(PARAMETERS) for key in best.values
    ):  # a named pair no more: its planner has changed
        names["system"] = f"{names['guide']}+{names['planner']}"
    map_set = build.map_set(config)
    evaluate.drive(config, names, map_set, directory)
    evaluate.report(map_set, directory)


def _book(tracking: Any, told: list[Trial], best: Trial, frame: pd.DataFrame, files: list[Path]) -> None:
    """One tracked run with a series of rewards: a run of its own for each trial takes longer than the trial."""
    from runners.analysis.summary import metrics

    rewards = [trial.reward for trial in told]
    series = {"reward": rewards, "best_reward": np.maximum.accumulate(rewards).tolist()}
    numbers = {"train_reward": best.reward, "trials": float(len(told))}
    places = list(dict.fromkeys(frame["map"]))
    for place in places:
        prefix = f"{place}_" if len(places) > 1 else ""
        found = metrics(frame[frame["map"] == place])
        numbers |= {f"{prefix}{key}": value for key, value in found.items()}
    numbers |= {f"best_{key.rpartition('.')[2]}": value for key, value in best.values.items()}
    tracking.finish(numbers, files, series)


def _fingerprint(config: DictConfig) -> str:
    return run_directories.fingerprint([run_directories.identity(config)], multirun=False)


def _name(config: DictConfig) -> str:
    """What the weights are registered as."""
    if config.name is not None:
        return str(config.name)
    place = config.map.get("name") or _class_name(config.map)
    parts = (config.robot.name, place, _class_name(config.search), config.seed, _fingerprint(config)[:8])
    return "-".join(map(str, parts))


def _class_name(node: DictConfig) -> str:
    return str(node["_target_"]).rpartition(".")[2].lower()


def _choice(group: str) -> str:
    """The option chosen in a config group."""
    return str(HydraConfig.get().runtime.choices[group])


def _without_password(plain: dict[str, Any]) -> dict[str, Any]:
    storage = plain["storage"]
    return plain if storage is None else {**plain, "storage": study.masked(storage)}


@contextlib.contextmanager
def _held(run_dir: Path) -> Iterator[None]:
    """Keep other processes out. Raises InputError where one is in."""
    with (run_dir / run_directories.LAUNCH).open("rb") as file:
        lock(file, run_dir)
        yield
