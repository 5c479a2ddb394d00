"""Counts the collisions of runs in static worlds, and says of each why it happened.

    lme eval system=lme_plus map.subset=fresh map.fresh_seed=31 map.count=100000 runs=1 hydra.run.dir=many
    python -m benchmarks.collisions many [RUN ...]

Each collision is driven again. Its class is that of the step after the last state from which the robot could stop
without touching anything that was seen (docs/understand/safety.md):

- command: the robot could not stop any more after the command;
- not seen: no point was known where the robot then collided;
- misplaced: with this command the robot stops before the known points, but not before the true obstacles;
- moved otherwise: it would have stopped before these, too, so it did not move as commands and limits say;
- never: there was no such state.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.command import run_main
from lme.geometry.arcs import clearances
from lme.geometry.frames import to_robot
from lme.perception.scan_points import BlindArc
from lme.planners.safety.check import STILL, StoppingCheck, StoppingState
from lme.types import Floats, Outcome, Pose
from runners.records.episode_record import EpisodeKey
from runners.records.records import read_episodes, read_trajectories
from runners.workers.trace import Trace, TracedStep, rerun_recorded

_NEAR = 5.0  # [cm] a known point this close to the place of the collision is of the same obstacle
_SURFACE = 0.005  # [m] between two points of an obstacle's surface
_REACH = 3.0  # [m] obstacles that count


def main() -> None:
    """Print the report."""
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    words.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="directory of a run of lme eval")
    for run in words.parse_args().runs:
        for line in report(run):
            print(line, flush=True)


def report(run_dir: Path) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    episodes = read_episodes([run_dir])
    struck = episodes[episodes["outcome"] == str(Outcome.COLLISION)]
    yield f"{run_dir}: {len(struck)} collisions in {len(episodes)} episodes"
    for world, run in struck[["world", "run"]].itertuples(index=False):
        trajectory = read_trajectories([run_dir], [EpisodeKey(world, run)])
        yield f"- world {world}, run {run}: {explained(rerun_recorded(run_dir, world, run, trajectory))}"


def explained(trace: Trace) -> str:
    """The class of a collision, and what it is concluded from."""
    decision = _last_that_stops(trace)
    if decision is None:
        return "never: the robot could not stop before what it saw at any step"
    step, state, check = decision
    contact = _touched(trace)
    v, omega = step.observation.twist
    ago = f"{trace.end.time - step.time:.1f} s before, at {v:.2f} m/s and {omega:.2f} rad/s"
    if not check.stops(step.command, state):
        return f"command: {ago}"
    distance_cm = 100.0 * np.hypot(*(state.points - to_robot(contact, step.pose)).T).min(initial=math.inf)
    if distance_cm > _NEAR:
        return f"not seen: {ago}; the nearest known point was {distance_cm:.0f} cm from the place"
    true = state._replace(points=to_robot(_surfaces(trace, step.pose), step.pose))
    name = "moved otherwise" if check.stops(step.command, true) else "misplaced"
    return f"{name}: {ago}; the nearest known point was {distance_cm:.1f} cm from the place"


def _last_that_stops(trace: Trace) -> tuple[TracedStep, StoppingState, StoppingCheck] | None:
    """The last step from whose state the robot could stop, that state, and a check with its commands under way."""
    robot, sim = trace.robot, trace.config.sim
    delays = sim.get("latency", 0.0), sim.get("lag", 0.0)
    decision, check = None, StoppingCheck(robot.footprint, robot.dt, *delays)
    blind = BlindArc(robot.lidar.mount, _REACH)
    for step in trace.steps:
        points = step.guidance.points
        points = blind.points(step.observation) if points is None else points
        state = StoppingState.of(step.observation, points)
        if check.stops(STILL, state):
            decision = step, state, [*check.under_way]
        check.sent(step.command)
    if decision is None:
        return None
    check.under_way.extend(decision[2])
    return decision[0], decision[1], check


def _touched(trace: Trace) -> Floats:
    """The place (2,) of an obstacle that is deepest in the outline at the end, in the world [m]."""
    points = _surfaces(trace, trace.end.pose)
    half_length, half_width, rounding = map(float, trace.robot.footprint.box)
    at_robot = to_robot(points, trace.end.pose)
    nearest: Floats = points[clearances(at_robot, (half_length, half_width, rounding)).argmin()]
    return nearest


def _surfaces(trace: Trace, pose: Pose) -> Floats:
    """Points (N, 2) of the obstacles' surfaces within reach of a pose, in the world [m]."""
    world = trace.task.world
    point_sets = [np.empty((0, 2))]
    for x, y, r in world.circles:
        angles = np.linspace(0.0, math.tau, math.ceil(math.tau * r / _SURFACE) + 1)
        point_sets.append(np.column_stack((x + r * np.cos(angles), y + r * np.sin(angles))))
    for x0, y0, x1, y1 in world.edges:
        shares = np.linspace(0.0, 1.0, math.ceil(math.hypot(x1 - x0, y1 - y0) / _SURFACE) + 1)[:, None]
        point_sets.append((1.0 - shares) * [x0, y0] + shares * [x1, y1])
    points = np.vstack(point_sets)
    nearby: Floats = points[np.hypot(*(points - pose[:2]).T) < _REACH]
    return nearby


if __name__ == "__main__":
    run_main(main)
