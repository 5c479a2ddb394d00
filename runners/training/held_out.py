"""Evaluation of a training's result on worlds that it never saw, its comparison with the start, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, cast

from runners.config import build, instantiate
from runners.config.changes import HELD_OUT, TRAINING, TRAINING_ROBOTS
from runners.config.escaping import counted
from runners.config.job import Job
from runners.config.schema import DriveConfig, EvalConfig, HeldOutConfig, TrainConfig
from runners.config.space import with_values
from runners.config.systems import systems
from runners.evaluate.evaluate import drive, report, run_labels
from runners.records import inputs
from runners.records.launch_record import launch_of
from runners.records.weight_file import other_settings
from runners.reports.analysis.paired import COLLISION, SUCCESS, Difference, difference, signed
from runners.reports.explainer import pages
from runners.workers.progress import activity
from runners.workers.trials import episode_reward

if TYPE_CHECKING:
    import pandas as pd

    from runners.reports.analysis.summary import Row


Places = Mapping[str, HeldOutConfig]
_REWARD = "reward"
_FEWEST = 10  # worlds: the bootstrap of fewer is too narrow
VERDICTS = {1: "better", 0: "level", -1: "worse"}


def held_out_places(job: Job[HeldOutConfig]) -> Places:
    """Return the maps of `held_out`, or else `map`."""
    config = job.config
    map_nodes = config.held_out or {job.choices["map"]: config.map}
    return {name: replace(config, map=node) for name, node in map_nodes.items()}


def evaluate_held_out(
    job: Job[HeldOutConfig],
    held_out: Places,
    values: Mapping[str, Any],
    weights: str,
    subject: str,
    subfolder: str = "",
) -> pd.DataFrame:
    """Evaluate values on every held-out map, and return the records.

    held_out: configs by name, each with its map and robot. values: by dotted config key. weights: name for the column
    `weights` of the records. subject: description of the values. Every map has its own directory in `subfolder`
    of the training's.
    """
    from runners.records.records import read_episodes

    for map_name, config in held_out.items():
        _evaluate_on(
            map_name, _evaluation(job, config, values, map_name, weights, subfolder), values, subject
        )
    return read_episodes([job.run_dir / subfolder / map_name for map_name in held_out])


def report_held_out(job: Job[HeldOutConfig], frame: pd.DataFrame) -> None:
    """Write and print the table of held-out records."""
    from runners.reports.analysis.tables import print_table, write_tables

    rows = _rows(job, frame)
    write_tables(frame, rows, job.run_dir)
    print_table(frame, rows)
    print(f"Weights, pictures, records and tables: {job.run_dir}")


def write_table(job: Job[HeldOutConfig], run_dir: Path) -> None:
    """Write the tables of one held-out map again."""
    from runners.records.records import read_episodes
    from runners.reports.analysis.tables import write_tables

    frame = read_episodes([run_dir])
    write_tables(frame, _rows(job, frame), run_dir)


def _rows(job: Job[HeldOutConfig], frame: pd.DataFrame) -> list[Row]:
    from runners.reports.analysis.summary import summarise

    return summarise(frame, systems=systems(job.folders))


def _evaluation(
    job: Job[HeldOutConfig],
    place_config: HeldOutConfig,
    values: Mapping[str, Any],
    map_name: str,
    weights: str,
    subfolder: str,
) -> Job[EvalConfig]:
    """Return the job that evaluates the values on one map."""
    # The keys that this config shares with that of lme eval, with the values found.
    tuned_config = with_values(place_config, values)
    own_robot = place_config.robot is not job.config.robot
    names = {field.name for field in fields(EvalConfig)} & {field.name for field in fields(tuned_config)}
    shared = {field_name: getattr(tuned_config, field_name) for field_name in names}
    config = EvalConfig(**{**shared, "weights": weights, "resume": False})
    return Job(
        config=config,
        choices=_choices(job, map_name, own_robot),
        overrides=job.overrides,
        changes=_changes(job, map_name, own_robot) | other_settings(values),
        folders=job.folders,
        run_dir=job.run_dir / subfolder / map_name,
    )


def _choices(job: Job[HeldOutConfig], map_name: str, own_robot: bool) -> dict[str, str]:
    """Return the options of the evaluation: the place has its own map, and perhaps its own robot."""
    choices = dict(job.choices)
    group_keys = [f"map@{HELD_OUT}{map_name}", f"map@{TRAINING}{map_name}"]
    choices["map"] = next((job.choices[key] for key in group_keys if key in job.choices), map_name)
    if own_robot:
        choices["robot"] = job.choices[f"robot@{TRAINING_ROBOTS}{map_name}"]
    return choices


def _changes(job: Job[HeldOutConfig], map_name: str, own_robot: bool) -> dict[str, Any]:
    """Return the changed keys of the evaluation on one map, without those of other maps."""
    key_prefixes = {f"{HELD_OUT}{map_name}.": "map.", f"{TRAINING}{map_name}.": "map."}
    key_prefixes |= {f"{TRAINING_ROBOTS}{map_name}.": "robot."} if own_robot else {}
    foreign = [HELD_OUT, TRAINING, TRAINING_ROBOTS]
    foreign += ["map."] if job.config.held_out else []
    foreign += ["robot."] if own_robot else []
    changes = {key: value for key, value in job.changes.items() if not key.startswith(tuple(foreign))}
    for prefix, group in key_prefixes.items():
        changes |= {
            key.replace(prefix, group, 1): value
            for key, value in job.changes.items()
            if key.startswith(prefix)
        }
    return changes


def _evaluate_on(map_name: str, job: Job[EvalConfig], values: Mapping[str, Any], subject: str) -> None:
    config, maps = job.config, build.map_set(job.config)
    worlds = f"{len(maps.numbers)} worlds of {map_name} that training never saw"
    print(f"Now {subject}: {worlds}, {counted(config.runs, 'run')} each")
    job.run_dir.mkdir(parents=True, exist_ok=True)
    launch = launch_of("eval", [job], [], False, None)
    launch.write(job.run_dir)
    inputs.keep(launch.inputs, job.run_dir)
    labels = replace(run_labels(job, maps), map=map_name)
    if other_settings(values):  # not the planner of the named pair any more
        labels = replace(labels, system=f"{labels.guide}+{labels.planner}")
    drive(config, labels, maps, job.run_dir)
    pages.make_requested_pages(config.explain, job.run_dir, instantiate.build(config.executor, "executor"))
    with activity(f"Table and picture of {map_name}"):
        report(maps, job)


@dataclass(frozen=True, slots=True)
class HeldOutComparison:
    """Paired comparison of result and start on the same worlds. success, collision, reward: those of the result."""

    success: float
    collision: float
    reward: float
    success_difference: Difference
    collision_difference: Difference
    reward_difference: Difference

    @property
    def worlds(self) -> int:
        """Number of worlds that both drove."""
        return self.success_difference.worlds

    @property
    def runs(self) -> int:
        """Number of runs in each world."""
        return self.success_difference.pairs // self.worlds

    @property
    def start_success(self) -> float:
        """Success rate of the start."""
        return self.success - self.success_difference.mean

    @property
    def start_collision(self) -> float:
        """Collision rate of the start."""
        return self.collision - self.collision_difference.mean

    @property
    def start_reward(self) -> float:
        """Mean reward of the start."""
        return self.reward - self.reward_difference.mean


@dataclass(frozen=True, slots=True)
class Verdict:
    """Comparison by held-out map and over all worlds. training_reward: that of the result on the training worlds."""

    by_place: dict[str, HeldOutComparison]
    overall: HeldOutComparison
    training_reward: float
    is_start: bool

    @property
    def sign(self) -> int:
        """1 for better, −1 for worse, 0 for a difference within the noise.

        Worse: a map has less success or more collisions, or the overall reward is lower. Better: the reward is higher.
        """
        if self.overall.worlds < _FEWEST:
            return 0
        fails_more = any(
            comparison.success_difference.high < 0.0 for comparison in self._comparisons.values()
        )
        if fails_more or self.collides_more:
            return -1
        change = self.overall.reward_difference
        return -1 if change.high < 0.0 else 1 if change.low > 0.0 else 0

    @property
    def collides_more(self) -> bool:
        """Return whether a map has more collisions beyond the noise, which the reward counts like time-outs."""
        return any(comparison.collision_difference.low > 0.0 for comparison in self._comparisons.values())

    @property
    def _comparisons(self) -> dict[str, HeldOutComparison]:
        """Comparisons by held-out map, and over all worlds."""
        return {**self.by_place, "all": self.overall}

    @property
    def mean_reward(self) -> float:
        """Mean of the maps' mean rewards, since families have equal weight in training, too."""
        return fmean(comparison.reward for comparison in self.by_place.values())

    @property
    def gap(self) -> float:
        """Reward in training minus that on the held-out maps."""
        return self.training_reward - self.mean_reward

    @property
    def is_worse(self) -> bool:
        """Return whether the start should be kept."""
        return self.sign < 0

    def lines(self, start: str) -> list[str]:
        """Return the comparison in words. start: name of the starting weights."""
        gap = f"Reward in training {self.training_reward:.3f}, on held-out maps {self.mean_reward:.3f}"
        if self.is_start:
            return [gap, f"Level: no trial was better than the weights started from ({start}); keep them"]
        lines = [f"Against {start}, paired:"]
        for map_name, comparison in self._comparisons.items():
            differences = {
                SUCCESS: comparison.success_difference,
                COLLISION: comparison.collision_difference,
                _REWARD: comparison.reward_difference,
            }
            texts = (f"{measure} {_text(change)}" for measure, change in differences.items())
            lines.append(f"  {map_name}: {', '.join(texts)}")
        return [*lines, gap, self._sentence(start)]

    def _sentence(self, start: str) -> str:
        if self.sign > 0:
            return (
                f"Better: the new weights earn more than {start}, beyond the noise, and fail and collide "
                "no more often"
            )
        if self.sign == 0:
            return f"Level: the new weights and {start} differ by no more than the noise"
        if self.collides_more:
            return f"Worse: the new weights collide more often; keep what you have ({start})"
        return f"Worse: keep what you have ({start})"

    def content(self) -> dict[str, Any]:
        """Return the comparison as entries of the weight file."""
        by_map = {
            map_name: {
                "worlds": comparison.worlds,
                "success": _rounded(comparison.success),
                "success_difference": _numbers(comparison.success_difference),
                "collision": _rounded(comparison.collision),
                "collision_difference": _numbers(comparison.collision_difference),
                "reward": _rounded(comparison.reward),
                "reward_difference": _numbers(comparison.reward_difference),
            }
            for map_name, comparison in self._comparisons.items()
        }
        return {
            "verdict": VERDICTS[self.sign],
            "reward_gap": _rounded(self.gap),
            "difference_to_start": by_map,
        }


def judge(held_out: Places, start: pd.DataFrame, result: pd.DataFrame, training_reward: float) -> Verdict:
    """Compare the records of the result with those of the start, both with rewards.

    held_out: configs by held-out map. training_reward: that of the result on the training worlds.
    """
    import pandas as pd

    start_frames, result_frames = (_by_place(held_out, frame) for frame in (start, result))
    by_place = {
        map_name: _comparison(start_frames[map_name], result_frames[map_name]) for map_name in held_out
    }
    overall = _comparison(
        *(pd.concat(frames.values(), ignore_index=True) for frames in (start_frames, result_frames))
    )
    return Verdict(by_place, overall, training_reward, start is result)


def with_rewards(held_out: Places, frame: pd.DataFrame) -> pd.DataFrame:
    """Return the held-out records with a column `reward`."""
    names = [Path(folder).name for folder in frame["run_dir"]]
    limits = {name: _limits(held_out[name]) for name in set(names)}
    episodes = zip(names, frame["world"], frame["outcome"], frame["steps"], strict=True)
    rewards = [
        episode_reward(cast(TrainConfig, held_out[name]), limits[name](int(world)), outcome, steps)
        for name, world, outcome, steps in episodes
    ]
    return frame.assign(**{_REWARD: rewards})


def _limits(config: DriveConfig) -> Callable[[int], float]:
    """Return a function that gives the time limit [s] of a world by its number."""
    fixed_limit = config.map.get("time_limit")
    if fixed_limit is not None:
        return lambda world: float(fixed_limit)
    maps = build.map_set(config)
    return cache(lambda world: maps.task(world).time_limit)


def _by_place(held_out: Places, frame: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the records of each map, with its name in `world`, since maps share world numbers."""
    names = frame["run_dir"].map(lambda folder: Path(folder).name)
    with_world_names = frame.assign(world=names + " " + frame["world"].astype(str))
    return {map_name: with_world_names[names == map_name] for map_name in held_out}


def _comparison(start: pd.DataFrame, result: pd.DataFrame) -> HeldOutComparison:
    success, collision, reward = (
        difference(start, result, quantity) for quantity in (SUCCESS, COLLISION, _REWARD)
    )
    assert success is not None
    assert collision is not None
    assert reward is not None  # both drove the same worlds
    success_rate, collision_rate = (
        float((result["outcome"] == outcome).mean()) for outcome in (SUCCESS, COLLISION)
    )
    reward_mean = float(result[_REWARD].mean())
    return HeldOutComparison(success_rate, collision_rate, reward_mean, success, collision, reward)


def _text(change: Difference) -> str:
    return f"{signed(change.mean)} ({signed(change.low)} to {signed(change.high)})"


def _numbers(change: Difference) -> list[float]:
    """Return mean and interval."""
    return [_rounded(value) for value in (change.mean, change.low, change.high)]


def _rounded(value: float) -> float:
    return round(float(value), 6)
