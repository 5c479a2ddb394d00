"""Replays written as a file for the rerun viewer (extra `rerun`)."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.requirements import install
from lme.robots import Robot
from lme.types import Floats
from runners.recordings.driver import ReplayStep

_BLUE, _ORANGE, _GREEN, _GREY = (0, 114, 178), (213, 94, 0), (0, 158, 115), (120, 120, 120)


def check_installed() -> None:
    """Raise InputError unless rerun-sdk, which writes the file, is installed."""
    try:
        import rerun  # noqa: F401
    except ImportError as error:
        raise InputError(f"rerun=true needs the package rerun-sdk: {install('rerun-sdk')}") from error


class RerunFile:
    """A file to which each decision is written as it is made, in the odometry frame and at its recorded time.

    Points and lines are 3D at height 0: rerun draws 2D ones with y downwards as in images, which swaps left and
    right.
    """

    def __init__(self, path: Path, name: str, robot: Robot) -> None:
        self.path = path
        self._name = name
        self._radius = robot.footprint.circumscribed_radius

    def __enter__(self) -> Self:
        check_installed()
        import rerun

        self._rerun = rerun
        self._stream = rerun.RecordingStream("lme_replay")
        self._stream.save(self.path)
        self._stream.send_recording_name(self._name)
        self._stream.log("map", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._way: list[tuple[float, float]] = []
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def show(self, step: ReplayStep) -> None:
        """Add one step."""
        pose = step.motion.pose
        position = np.array(pose[:2])
        self._stream.set_time("recording", duration=step.time_s)
        self._points("scan", to_world(step.points, pose), 0.02, _GREY)
        self._points("robot", position[None], self._radius, _BLUE)
        self._points("subgoal", to_world(step.subgoal, pose)[None], 0.06, _ORANGE)
        self._points("goal", to_world(step.target, pose)[None], 0.08, _GREEN)
        arrow = to_world(np.array([2 * self._radius, 0.0]), pose) - position
        arrows = self._rerun.Arrows3D(
            origins=_flat(position[None]), vectors=_flat(arrow[None]), colors=[_BLUE]
        )
        self._stream.log("map/heading", arrows)
        self._way = [*self._way[-1:], (pose.x, pose.y)]
        self._stream.log("map/way", self._rerun.LineStrips3D([_flat(np.array(self._way))], colors=[_BLUE]))
        for name, robot, proposed in zip(("v", "omega"), step.motion.twist, step.command, strict=True):
            self._stream.log(f"{name}/robot", self._rerun.Scalars(robot))
            self._stream.log(f"{name}/proposed", self._rerun.Scalars(proposed))

    def _points(self, name: str, points: Floats, radius: float, colour: tuple[int, int, int]) -> None:
        markers = self._rerun.Points3D(_flat(points), radii=radius, colors=colour)
        self._stream.log(f"map/{name}", markers)


def _flat(points: Floats) -> Floats:
    """Return points (N, 2) as (N, 3) at height 0."""
    return np.column_stack([points, np.zeros(len(points))])
