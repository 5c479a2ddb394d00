"""Encode an episode for the explainer page.

The page computes scores again and must choose as LME does, so the inputs of a decision are exact, or rounded where
that changes no choice (`features.py`). Values that are only drawn are rounded to the millimetre or to single precision.
What the page can compute itself is left out (`drawn.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lme.geometry.frames import to_robot, to_world
from lme.guides.lme.criteria import SURMOUNT
from lme.guides.lme.explanation import Explanation
from lme.guides.lme.guide import PAPER_CRITERIA
from lme.guides.lme.maintenance import Choice
from lme.guides.lme_plus.criteria import CRITERIA as PLUS_CRITERIA
from lme.perception.people.source import People
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Floats, Ints, LaserScan
from lme.worlds.world import World
from runners.config import build
from runners.config.schema import SystemConfig
from runners.reports.explainer.drawn import add_computed, drawn_candidates
from runners.reports.explainer.features import add_features, add_rounded_features
from runners.reports.explainer.packer import Packer
from runners.workers.trace import Trace, TracedStep, TraceEnd

CELL_M = 0.05  # side of a cell of the world seen so far
CHOICES = tuple(Choice)
NONE = np.full(2, np.nan)


class Stretch(NamedTuple):
    """Successive moments of a drive.

    frames: the steps, and the end if it is among them. track: (F, 10), a row per frame, columns TRAJECTORY_COLUMNS.
    movers: circles (C, 3) and edges (E, 4) at each frame.
    """

    robot: Robot
    steps: Sequence[TracedStep]
    frames: Sequence[TracedStep | TraceEnd]
    track: Floats
    movers: Sequence[tuple[Floats, Floats]]


def encode(trace: Trace, sentences: Sequence[str], system: str = "", play: str = "", story: str = "") -> str:
    """Return an episode, with one sentence per decision, as base64 text. system, play, story: see `write.page`."""
    packer = Packer()
    movers = [trace.moving(frame) for frame in trace.frames]
    stretch = Stretch(trace.robot, trace.steps, trace.frames, trace.episode.trajectory, movers)
    # What happened, then what the guide thought, then the header.
    _drive(packer, stretch)
    _scans(packer, stretch)
    add_world(packer, trace.task.world)
    _movers(packer, stretch)
    reasons = [step.explanation for step in trace.steps if step.explanation is not None]
    _add_thoughts(packer, stretch, reasons, plans_paths(trace.steps), tracks_people(trace.config))
    header = _header(trace, system) | {"story": story} | ({"play": play} if play else {})
    if reasons:
        header |= (
            _add_candidates(packer, trace, reasons) | policy(reasons[0]) | {"sentences": list(sentences)}
        )
    else:
        header |= {"explained": False}
    return packer.text(header)


def _add_candidates(packer: Packer, trace: Trace, reasons: Sequence[Explanation]) -> dict[str, Any]:
    """Add candidates and features in as few bytes as they need, and return what the header says of them."""
    drawing = drawn_candidates(trace, reasons)
    header: dict[str, Any] = {}
    firsts = [0] * len(reasons[0].names)
    if drawing is None:
        _add_points_mm(packer, "candidates", [reason.candidates for reason in reasons])
    else:
        # Leave out what the page draws and computes itself.
        v_max = trace.robot.capped(trace.config.cap).v_max
        computed = add_computed(packer, reasons, drawing.number, v_max)
        header = {"drawn": drawing._asdict(), "computed": computed, "v_max": v_max}
        firsts = [drawing.number * (name in computed) for name in reasons[0].names]
        packer.add_counts("candidates", [reason.candidates for reason in reasons])
        _add_mm(
            packer, "candidates", np.concatenate([reason.candidates[drawing.number :] for reason in reasons])
        )
    if reasons[0].way is None:
        add_features(packer, reasons, firsts)
        return header
    return header | {"quantum": add_rounded_features(packer, reasons, firsts)}


def add_stretch(packer: Packer, stretch: Stretch, planned: bool, tracked: bool) -> None:
    """Add a part of a drive, without the cells that it sees. planned, tracked: as in the header of the whole."""
    _drive(packer, stretch)
    _add_points_mm(packer, "scan", _scan_points(stretch))
    _movers(packer, stretch)
    reasons = [step.explanation for step in stretch.steps if step.explanation is not None]
    _add_thoughts(packer, stretch, reasons, planned, tracked)
    if reasons:
        _add_points_mm(packer, "candidates", [reason.candidates for reason in reasons])
        add_features(packer, reasons, [0] * len(reasons[0].names))


def _add_thoughts(
    packer: Packer, stretch: Stretch, reasons: Sequence[Explanation], planned: bool, tracked: bool
) -> None:
    """Add what the guide gave at each step, without its candidates. reasons: of those steps that have one."""
    if planned:
        _plans(packer, stretch)
    if tracked:
        _people(packer, stretch)
    if reasons:
        _decisions(packer, reasons)
        _obstacles(packer, reasons)


def episode_title(trace: Trace) -> str:
    """Return the name of the episode."""
    return f"{trace.task.map_name} {trace.world}, run {trace.run}"


def _header(trace: Trace, system: str) -> dict[str, Any]:
    robot, task, episode = trace.robot, trace.task, trace.episode
    return {
        "title": episode_title(trace),
        "system": system,
        "ablation": ", ".join(f"{name}={float(value):g}" for name, value in trace.config.ablation.items()),
        "robot": robot.name,
        "outcome": str(episode.outcome),
        "time": episode.time,
        "steps": len(trace.steps),
        "planned": plans_paths(trace.steps),
        "mapped": _is_mapped(trace),
        "tracked": tracks_people(trace.config),
        **robot_header(robot),
        "lidar": robot.lidar.mount,
        "goal": task.goal.tolist(),
        "goal_tolerance": task.goal_tolerance,
        "start": list(task.start),
    }


def robot_header(robot: Robot) -> dict[str, Any]:
    """Return what is drawn of a robot, and the duration of its steps."""
    return {"dt": robot.dt, "box": robot.footprint.box, "cell": CELL_M}


def policy(explanation: Explanation) -> dict[str, Any]:
    """Return what the page needs to decide. Infinity is written as a word, since JSON has none.

    timed: whether the score is minus a time [s], apart from c_o.
    """
    weights = dict(zip(explanation.names, explanation.parameters.weights.tolist(), strict=True))
    parameters = {**weights, "d1": explanation.parameters.d1, "d2": explanation.parameters.d2}
    return {
        "explained": True,
        "timed": explanation.way is not None,
        "names": explanation.names,
        "about": {name: _first_line(name, explanation) for name in explanation.names},
        "parameters": {name: value if math.isfinite(value) else "inf" for name, value in parameters.items()},
        "choices": CHOICES,
    }


def _first_line(name: str, explanation: Explanation) -> str:
    """Return the first line of a criterion's docstring, from LME or LME+, for the interpretation that is in use."""
    criteria: Mapping[str, Callable[..., Floats]] = {
        **PAPER_CRITERIA,
        "a_mount": SURMOUNT[explanation.view.surmount],
    }
    if PLUS_CRITERIA.keys() == set(explanation.names):
        criteria = PLUS_CRITERIA
    criterion = criteria.get(name)
    return (criterion.__doc__ or "").partition("\n")[0] if criterion else "A criterion of your own."


def _drive(packer: Packer, stretch: Stretch) -> None:
    """Add poses, twists, clearance and targets of all frames, and commands and subgoals of all steps."""
    steps, track = stretch.steps, stretch.track
    packer.add_singles("time", track[:, 0])
    packer.add_singles("pose", track[:, 1:4])
    packer.add_singles("twist", track[:, 4:6])
    packer.add_singles("clearance", track[:, 9])
    packer.add_singles("command", np.array([step.command for step in steps]))
    packer.add_singles("subgoal", np.array([step.guidance.subgoal for step in steps]))
    packer.add_integers("switched", [step.guidance.switched for step in steps])
    packer.add_singles("target", np.array([frame.observation.target for frame in stretch.frames]))


def _scans(packer: Packer, stretch: Stretch) -> None:
    """Add the scan of every frame, and the cells of the world that each step sees for the first time."""
    frames, mount = stretch.frames, stretch.robot.lidar.mount
    points = _scan_points(stretch)
    steps = np.repeat(np.arange(len(frames)), [len(cloud) for cloud in points])
    # Beams and ranges need half the bytes of the points, since those of neighbours are similar.
    scans = [frame.observation.scan for frame in frames]
    at_lidar = [to_robot(cloud, mount) for cloud in points]
    beams = [beams_of(cloud, scan) for cloud, scan in zip(at_lidar, scans, strict=True)]
    packer.add_counts("scan", points)
    packer.add_doubles("beams", [(scan.angle_min, scan.angle_increment) for scan in scans])
    packer.add_integers("scan.beam", np.concatenate(beams), differences=True)
    packer.add_integers(
        "scan.range", np.rint(1000.0 * np.hypot(*np.concatenate(at_lidar).T)), differences=True
    )
    # Each cell belongs to the first step that saw it.
    placed = np.concatenate(
        [to_world(cloud, frame.pose) for cloud, frame in zip(points, frames, strict=True)]
    )
    cells, first_rows = np.unique(cells_of(placed), axis=0, return_index=True)
    seen_at = steps[first_rows]
    order = np.argsort(seen_at, kind="stable")
    add_seen(packer, np.bincount(seen_at, minlength=len(frames)), cells[order])


def beams_of(points: Floats, scan: LaserScan) -> Floats:
    """Return the numbers (N,) of the beams that hit points (N, 2) in the lidar frame."""
    half = (
        scan.angle_increment / 2.0
    )  # so that a point a rounding before the first beam is not a turn after it
    turned = np.arctan2(points[:, 1], points[:, 0]) - scan.angle_min + half
    return np.floor(np.mod(turned, math.copysign(math.tau, half)) / scan.angle_increment)


def _scan_points(stretch: Stretch) -> list[Floats]:
    """Return the scan points of every frame in the robot frame."""
    mount = stretch.robot.lidar.mount
    return [obstacle_points(frame.observation.scan, mount) for frame in stretch.frames]


def cells_of(points: Floats) -> Ints:
    """Return the cells (N, 2) that contain the points (N, 2) of the world."""
    return np.floor(points / CELL_M).astype(np.int64)


def add_seen(packer: Packer, counts: Ints, cells: Ints) -> None:
    """Add the cells (N, 2) seen for the first time, and their number (F,) in each frame."""
    packer.add_integers("seen.count", counts)
    packer.add_integers("seen.x", cells[:, 0], differences=True)
    packer.add_integers("seen.y", cells[:, 1], differences=True)


def add_world(packer: Packer, world: World) -> None:
    """Add the true world, which the robot does not know, without its moving parts."""
    packer.add_singles("world.circles", world.circles)
    packer.add_singles("world.segments", world.segments)
    packer.add_counts("polygons", world.polygons)
    packer.add_singles("polygons", np.concatenate([np.empty((0, 2)), *world.polygons]))


def _movers(packer: Packer, stretch: Stretch) -> None:
    """Add the moving objects at every frame."""
    for name, moving in zip(("discs", "edges"), zip(*stretch.movers, strict=True), strict=True):
        packer.add_counts(name, moving)
        packer.add_singles(name, np.concatenate(moving))


def _is_mapped(trace: Trace) -> bool:
    """Return whether the true world is known, as it is not for a real robot."""
    world = trace.task.world
    obstacles = (world.circles, world.segments, world.polygons, *trace.moving(trace.frames[0]))
    return any(len(geometry) for geometry in obstacles)


def plans_paths(steps: Sequence[TracedStep]) -> bool:
    """Return whether the guide plans paths."""
    return any(step.guidance.path is not None for step in steps)


def _plans(packer: Packer, stretch: Stretch) -> None:
    """Add the planned path of every step."""
    paths = [step.guidance.path for step in stretch.steps]
    _add_points_mm(packer, "plan", [np.empty((0, 2)) if path is None else path for path in paths])


def tracks_people(config: SystemConfig) -> bool:
    """Return whether the system finds people in the scans."""
    return build.people_of(config) is People.tracked


def _people(packer: Packer, stretch: Stretch) -> None:
    """Add the tracks of every step in the robot frame, with their velocities."""
    pedestrians = [step.observation.pedestrians for step in stretch.steps]
    packer.add_counts("people", pedestrians)
    packer.add_singles("people", np.concatenate([np.empty((0, 4)), *pedestrians]))


def _decisions(packer: Packer, reasons: Sequence[Explanation]) -> None:
    """Add the choice of every step, and the old subgoal that the best candidate was compared with."""
    old_subgoals = np.array([NONE if reason.old is None else reason.old for reason in reasons])
    num_criteria = len(reasons[0].names)
    nothing = np.full(num_criteria, np.nan)
    packer.add_integers("new", [reason.new for reason in reasons])
    packer.add_integers("choice", [CHOICES.index(reason.decision.choice) for reason in reasons])
    packer.add_integers("blocked", [reason.decision.blocked for reason in reasons])
    packer.add_singles("old", old_subgoals)
    packer.add_doubles("old_distance", [math.hypot(x, y) for x, y in old_subgoals])
    features = [nothing if reason.old_features is None else reason.old_features for reason in reasons]
    packer.add_doubles("old_features", np.array(features))


def _obstacles(packer: Packer, reasons: Sequence[Explanation]) -> None:
    """Add the sectors of the scan, the blocking one, and the recent positions."""
    sectors = [reason.sectors for reason in reasons]
    packer.add_counts("sectors", sectors)
    packer.add_integers("sectors", np.concatenate(sectors))
    packer.add_integers("blocking", [_blocking_sector(reason) for reason in reasons])
    blockages = [reason.view.blockage for reason in reasons]
    ends_at_first = [
        0 if blockage is None else np.array_equal(blockage.A, blockage.E1) for blockage in blockages
    ]
    packer.add_integers("a_is_e1", ends_at_first)
    packer.add_singles("b", np.array([NONE if blockage is None else blockage.B for blockage in blockages]))
    history = [reason.view.history for reason in reasons]
    packer.add_counts("history", history)
    packer.add_singles("history", np.concatenate(history))


def _blocking_sector(explanation: Explanation) -> int:
    """Return the index of the sector with the ends E1 and E2; −1 if none blocks."""
    blockage, points = explanation.view.blockage, explanation.view.points
    if blockage is None:
        return -1
    # The first and last point of each sector are its ends.
    ends = points[explanation.sectors]
    matches = (ends[:, 0] == blockage.E1).all(axis=1) & (ends[:, 1] == blockage.E2).all(axis=1)
    return int(np.argmax(matches))


def _add_points_mm(packer: Packer, name: str, rows: Sequence[Floats], differences: bool = False) -> None:
    """Add (N, 2) points [m] of every step, rounded to the millimetre."""
    packer.add_counts(name, rows)
    _add_mm(packer, name, np.concatenate([np.empty((0, 2)), *rows]), differences)


def _add_mm(packer: Packer, name: str, points: Floats, differences: bool = False) -> None:
    """Add (N, 2) points [m], rounded to the millimetre."""
    millimetres = np.rint(points * 1000.0)
    packer.add_integers(f"{name}.x", millimetres[:, 0], differences)
    packer.add_integers(f"{name}.y", millimetres[:, 1], differences)
