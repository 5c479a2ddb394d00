"""Messages to the page: the situation and the options as JSON, and what it draws as binary (`packer.Packer`)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from lme.geometry.frames import to_world
from lme.guides.lme_plus.guide import LmePlus
from lme.perception.scan_points import obstacle_points
from lme.planners.commands import Weighing
from lme.planners.safety.filter import SafetyFilter
from runners.config import catalogue, systems
from runners.play.drawing import MOVERS, Sketch
from runners.play.session import Session, Setup
from runners.play.simulation_track import Frame, SimulationTrack, Tasks, trajectory_of
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
LAYERS = ("memory", "times", "arcs")
GROUPS = ("robot", "map", "sim", "crowd", "ablation")
SIM_KEYS = (
    "latency",
    "lag",
    "slip",
    "odometry_error",
    "scan_noise",
    "scan_dropout",
    "goal_noise",
    "goal_noise_yaw",
)
ROBOT_KEYS = ("v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate")
LIDAR_KEYS = ("num_beams", "fov", "range_max", "noise_std")
_MOST_NUMBERS = 5000  # most worlds that are listed


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
        moments, movers = [frame.moment for frame in frames], [frame.movers for frame in frames]
        stretch = Stretch(lane.config.robot, steps, moments, trajectory_of(frames), movers)
        add_stretch(packer, stretch, header["planned"], header["tracked"])
        legs = [frame.state.legs for frame in frames if frame.state.legs is not None]
        if legs:
            packer.add_counts("legs", legs)
            packer.add_singles("legs", np.concatenate(legs))
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


def detail_message(
    lane: SimulationTrack, step: int, tasks: Tasks, layers: Collection[str], header_fields: dict[str, Any]
) -> bytes:
    """Return those of the requested layers that the decision has.

    memory: obstacle points that the guide knows, in the robot frame. times: expected times on a grid, in the frame in
    which `pose` is the pose of the robot. arcs: commands that the planner tried, with their costs.
    """
    packer, header = Packer(), dict(header_fields)
    frame = lane.frames[min(step, len(lane.frames) - 1)]
    moment = frame.moment
    if isinstance(moment, TracedStep):
        if "memory" in layers and moment.guidance.points is not None:
            packer.add_singles("memory", moment.guidance.points)
        if {"times", "arcs"} & {*layers}:
            header |= _explanation_fields(packer, lane, step, tasks, layers, moment)
    return packer.raw(header)


def _explanation_fields(
    packer: Packer,
    lane: SimulationTrack,
    step: int,
    tasks: Tasks,
    layers: Collection[str],
    moment: TracedStep,
) -> dict[str, Any]:
    """Add what the guide and the planner computed to the packer, and return the entries of the header."""
    # Work on a copy of the episode, so that the drive itself stays as it is.
    episode = lane.before(step, tasks)
    if episode is None:
        return {}
    header: dict[str, Any] = {}
    guide, planner = episode.navigator.guide, episode.navigator.planner
    planner = planner.planner if isinstance(planner, SafetyFilter) else planner
    if "arcs" in layers and isinstance(planner, Weighing):
        weighed = planner.weighed(moment.observation, moment.guidance)
        packer.add_singles("arcs", weighed.commands)
        packer.add_singles("costs", weighed.costs)
        header["horizon"] = weighed.horizon
    if "times" in layers and isinstance(guide, LmePlus):
        episode.decide()
        sight = guide.sight
        assert sight is not None
        field = sight.field
        inner = field.times[1:-1, 1:-1]  # without the border of one cell
        packer.add_singles("times", np.where(np.isfinite(inner), inner, np.nan))
        header["grid"] = [field.grid.x, field.grid.y, field.grid.cell, field.grid.size]
        header["pose"] = list(sight.pose)
    return header


def situation(session: Session, num_kept: int) -> dict[str, Any]:
    """Return the session's state after a change. num_kept: number of frames that the page may keep."""
    setup = session.script.setup
    return {
        "type": "situation",
        "revision": session.revision,
        "kept": num_kept,
        "step": session.shown,
        "lanes": [head(lane) for lane in session.lanes],
        "words": list(setup.source.words) if setup.source else [],
        "map": setup.task.map_name,
        "world": setup.task.number,
        "worlds": list(setup.numbers[:_MOST_NUMBERS]),
        "run": setup.run,
        "seed": setup.seed,
        "values": _values(setup),
        "undoable": session.undoable,
        "redoable": session.redoable,
    }


def options(folders: tuple[Path, ...], maps: list[str]) -> dict[str, Any]:
    """Return all options by name, with what they are. maps: files of maps that can be opened."""
    return {"type": "options", "files": maps, **_named_options(folders)}


@cache
def _named_options(folders: tuple[Path, ...]) -> dict[str, Any]:
    configs = catalogue.Catalogue(folders)
    groups: dict[str, Any] = {group: configs.titles(group) for group in GROUPS}
    groups["map"].pop("file", None)  # it needs a path, which `files` give
    groups["system"] = {name: system.label for name, system in systems.systems(folders).items()}
    groups["weights"] = {name: configs.title(f"weight_set/{name}") for name in configs.options("weight_set")}
    return groups


def _values(setup: Setup) -> dict[str, Any]:
    """Return the numbers that can be set, by key, with their present values in the first system."""
    config = setup.systems[0].config
    robot, lidar = config.robot, asdict(config.robot.lidar)
    values = {f"robot.{key}": getattr(robot, key) for key in ROBOT_KEYS}
    values |= {f"robot.lidar.{key}": lidar[key] for key in LIDAR_KEYS}
    return values | {f"sim.{key}": config.sim[key] for key in SIM_KEYS if key in config.sim}
