"""Comparison of a training's result with its start on held-out worlds, and the verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, cast

from runners.config import build
from runners.config.schema import DriveConfig, TrainConfig
from runners.reports.analysis.paired import SUCCESS, Difference, difference, signed
from runners.training.held_out import Places
from runners.workers.trials import episode_reward

if TYPE_CHECKING:
    import pandas as pd

_REWARD = "reward"
_FEWEST = 10  # worlds: the bootstrap of fewer is too narrow
_WORDS = {1: "better", 0: "level", -1: "worse"}


@dataclass(frozen=True, slots=True)
class HeldOutComparison:
    """Paired comparison of result and start on the same worlds. success, reward: those of the result."""

    success: float
    reward: float
    success_difference: Difference
    reward_difference: Difference


@dataclass(frozen=True, slots=True)
class Verdict:
    """Comparison by held-out map and over all worlds. training_reward: that of the result on the training worlds."""

    by_place: dict[str, HeldOutComparison]
    overall: HeldOutComparison
    training_reward: float
    is_start: bool

    @property
    def sign(self) -> int:
        """−1 if a map's success or the overall reward is worse beyond the noise, 1 if the reward is better, or 0."""
        if self.overall.success_difference.worlds < _FEWEST:
            return 0
        if any(
            comparison.success_difference.high < 0.0 for comparison in (*self.by_place.values(), self.overall)
        ):
            return -1
        change = self.overall.reward_difference
        return -1 if change.high < 0.0 else 1 if change.low > 0.0 else 0

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
        for map_name, comparison in {**self.by_place, "all": self.overall}.items():
            success, reward = (
                _text(change) for change in (comparison.success_difference, comparison.reward_difference)
            )
            lines.append(f"  {map_name}: success {success}, reward {reward}")
        return [*lines, gap, self._sentence(start)]

    def _sentence(self, start: str) -> str:
        if self.sign > 0:
            return f"Better: the new weights earn more than {start}, beyond the noise, and fail no more often"
        if self.sign == 0:
            return f"Level: the new weights and {start} differ by no more than the noise"
        return f"Worse: keep what you have ({start})"

    def content(self) -> dict[str, Any]:
        """Return the comparison as entries of the weight file."""
        by_map = {
            map_name: {
                "worlds": comparison.success_difference.worlds,
                "success": _rounded(comparison.success),
                "success_difference": _numbers(comparison.success_difference),
                "reward": _rounded(comparison.reward),
                "reward_difference": _numbers(comparison.reward_difference),
            }
            for map_name, comparison in {**self.by_place, "all": self.overall}.items()
        }
        return {"verdict": _WORDS[self.sign], "reward_gap": _rounded(self.gap), "difference_to_start": by_map}


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
    success, reward = (difference(start, result, quantity) for quantity in (SUCCESS, _REWARD))
    assert success is not None
    assert reward is not None  # both drove the same worlds
    return HeldOutComparison(
        float((result["outcome"] == SUCCESS).mean()), float(result[_REWARD].mean()), success, reward
    )


def _text(change: Difference) -> str:
    return f"{signed(change.mean)} ({signed(change.low)} to {signed(change.high)})"


def _numbers(change: Difference) -> list[float]:
    """Return mean and interval."""
    return [_rounded(value) for value in (change.mean, change.low, change.high)]


def _rounded(value: float) -> float:
    return round(float(value), 6)
