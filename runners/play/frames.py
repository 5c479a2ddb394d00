"""Binary messages with what the page draws (`runners.reports.explainer.packer`), read by `assets/live.js`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lme.geometry.frames import to_world
from lme.perception.scan_points import obstacle_points
from runners.play.drawing import MOVERS, Sketch
from runners.play.simulation_track import Frame, SimulationTrack
from runners.reports.explainer.encode import (
    Stretch,
    add_seen,
    add_stretch,
    add_world,
    cells_of,
    plans_paths,
    policy,
    robot_header,
    tracks_people,
)
from runners.reports.explainer.packer import Packer
from runners.workers.trace import TracedStep

MOST_PARTS = 4000  # most parts that the page can drag; in a larger world they are only drawn


def head(lane: SimulationTrack) -> dict[str, Any]:
    """Return the facts that hold for a whole drive: the robot, and the criteria by which the guide decides."""
    steps = [frame.moment for frame in lane.frames[:1] if isinstance(frame.moment, TracedStep)]
    reasons = [step.explanation for step in steps if step.explanation is not None]
    return {
        "system": lane.label,
        "robot": lane.config.robot.name,
        **robot_header(lane.config.robot),
        "reach": lane.config.robot.lidar.range_max,
        "planned": plans_paths(steps),
        "tracked": tracks_people(lane.config),
        "mapped": True,
        **(policy(reasons[0]) if reasons else {"explained": False}),
    }


class Sender:
    """Encoder of the frames of one lane, each of which is encoded once."""

    def __init__(self) -> None:
        self._cells_by_frame: list[np.ndarray[Any, Any]] = []  # cells that each frame saw first
        self._sent_cells: set[tuple[int, int]] = set()

    @property
    def sent(self) -> int:
        """Number of frames that have been encoded."""
        return len(self._cells_by_frame)

    def forget(self, step: int) -> None:
        """Encode the frames from `step` on again next time."""
        if step < self.sent:
            self._cells_by_frame = self._cells_by_frame[:step]
            self._sent_cells = {(x, y) for cells in self._cells_by_frame for x, y in cells.tolist()}

    def frames(self, lane: SimulationTrack, end_step: int, header_fields: dict[str, Any]) -> bytes:
        """Encode the frames before `end_step` that were not encoded yet, with further fields in the header."""
        start_step = self.sent
        frames = lane.frames[start_step:end_step]
        packer = Packer()
        steps = [frame.moment for frame in frames if isinstance(frame.moment, TracedStep)]
        header = head(lane)
        add_stretch(packer, _stretch(lane, frames, steps), header["planned"], header["tracked"])
        self._add_seen(packer, lane, frames)
        return packer.raw(
            {
                **header_fields,
                "from": start_step,
                "count": len(frames),
                "decisions": len(steps),
                "sentences": [frame.sentence for frame in frames],
                "decision_us": [round(frame.decision_us) for frame in frames],
                "outcome": str(lane.outcome)
                if lane.outcome and len(lane.frames) == start_step + len(frames)
                else None,
            }
        )

    def _add_seen(self, packer: Packer, lane: SimulationTrack, frames: Sequence[Frame]) -> None:
        mount = lane.config.robot.lidar.mount
        num_before = len(self._cells_by_frame)
        # Each cell belongs to the first frame whose scan hit it.
        for frame in frames:
            points = to_world(obstacle_points(frame.moment.observation.scan, mount), frame.moment.pose)
            cells = dict.fromkeys(map(tuple, cells_of(points).tolist()))
            fresh_cells = [cell for cell in cells if cell not in self._sent_cells]
            self._sent_cells.update(fresh_cells)
            self._cells_by_frame.append(np.array(fresh_cells, dtype=np.int64).reshape(-1, 2))
        new_cells = self._cells_by_frame[num_before:]
        add_seen(packer, np.array([len(cells) for cells in new_cells]), np.concatenate(new_cells))


def world_message(drawing: Sketch, header_fields: dict[str, Any]) -> bytes:
    """Encode a world with its start and goal. If it has few enough parts to be dragged, they are included."""
    packer = Packer()
    task = drawing.task()
    add_world(packer, task.world)
    world = task.world
    # In a world of too many parts, only drawn items and movers are sent one by one.
    count = len(world.circles) + len(world.segments) + len(world.polygons) + len(world.movers)
    entries = [
        {"name": name, "kind": item.kind, "entry": item.entry}
        for name, item in drawing.parts()
        if count <= MOST_PARTS or name in drawing.items or item.kind == MOVERS
    ]
    return packer.raw(
        {
            **header_fields,
            "start": list(drawing.start),
            "goal": list(drawing.goal),
            "goal_tolerance": task.goal_tolerance,
            "time_limit": task.time_limit,
            "parts": entries,
            "editable": count <= MOST_PARTS,
            "touched": drawing.touched,
        }
    )


def _stretch(lane: SimulationTrack, frames: Sequence[Frame], steps: Sequence[TracedStep]) -> Stretch:
    rows = np.array([frame.row for frame in frames])
    track = np.full((len(frames), 10), np.nan)
    track[:, :6], track[:, 9] = rows[:, :6], rows[:, 6]
    movers = [frame.movers for frame in frames]
    return Stretch(lane.config.robot, steps, [frame.moment for frame in frames], track, movers)
