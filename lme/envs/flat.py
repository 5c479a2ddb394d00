"""The observation as one vector of numbers in [−1, 1], in the style of ros_jackal: scan, target, last action."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lme.envs.spaces import Arrays
from lme.errors import InputError, require

TARGET_CLIPS = 2.0  # distance at which the target is 1, in clips of the scan


class FlatObservation(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """(beams + 4,) float32: the scan clipped at `clip` [m], the target, and the last action.

    beams: their number; each is the nearest return of a group of neighbouring beams of the lidar. None: all beams.
    A target farther away than twice the clip is moved in to that distance. At the start the last action is 0.
    Source: Daffan/ros_jackal, where the robot learns to drive in the BARN worlds.
    """

    def __init__(self, env: gym.Env[Any, Any], clip: float = 5.0, beams: int | None = None) -> None:
        """Raises InputError unless `beams` divides those of the lidar."""
        gym.utils.RecordConstructorArgs.__init__(self, clip=clip, beams=beams)
        gym.Wrapper.__init__(self, env)
        require("clip", clip, above=0.0)
        scan = env.observation_space["scan"]  # type: ignore[index]
        (have,) = scan.shape
        self._clip, self._beams = clip, have if beams is None else beams
        if self._beams < 1 or have % self._beams:
            raise InputError(f"beams is {beams}: must divide the lidar's {have}")
        self.observation_space = spaces.Box(-1.0, 1.0, (self._beams + 4,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """See the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._flat(observation, np.zeros(2)), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]:
        """See the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._flat(observation, np.clip(action, -1.0, 1.0)), reward, terminated, truncated, info

    def _flat(self, seen: Arrays, action: Any) -> NDArray[np.float32]:
        return flattened(seen, np.asarray(action), self._beams, self._clip)


def flattened(seen: Arrays, action: NDArray[Any], beams: int, clip: float = 5.0) -> NDArray[np.float32]:
    """The vectors (..., beams + 4) of `FlatObservation` for observations of one robot or of many.

    action (..., 2): the last one, in [−1, 1]; beams: a divisor of the lidar's; clip [m].
    """
    scan, target = seen["scan"], seen["target"]
    nearest = scan.reshape(*scan.shape[:-1], beams, -1).min(axis=-1)
    away = np.hypot(target[..., :1], target[..., 1:])
    parts = (
        np.minimum(nearest, clip) / clip * 2.0 - 1.0,
        target / np.maximum(TARGET_CLIPS * clip, away),
        action,
    )
    return np.concatenate(parts, axis=-1).astype(np.float32)
