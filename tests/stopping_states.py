"""Random robots, obstacle points, states and drives for the invariant of docs/understand/safety.md."""

import math
from typing import NamedTuple

import numpy as np

from lme.geometry.frames import to_robot
from lme.planners.safety.check import STILL, StoppingCheck, StoppingState
from lme.robots import Footprint
from lme.types import Guidance, Pose, Twist
from tests import oracles
from tests.builders import SHIPPED, observation, shipped, stage

SHIPS = [shipped(name) for name in SHIPPED]
DELAYS = [
    (0.0, 0.0),
    (0.0, 0.0),
    (0.1, 0.0),
    (0.03, 0.0),
    (0.25, 0.0),
    (0.0, 0.3),
    (0.1, 0.1),
]  # latency, lag [s]


class Steps(NamedTuple):
    """Steps from states in which the robot could stop, starts in which it could not, and steps to such a state."""

    counted: int
    not_counted: int
    broken: int


def random_robot(rng):
    if rng.random() < 0.4:
        return SHIPS[rng.integers(len(SHIPS))]
    disc = Footprint(radius=rng.uniform(0.1, 0.4))
    box = Footprint(length=rng.uniform(0.2, 0.8), width=rng.uniform(0.2, 0.8))
    return stage(
        footprint=disc if rng.random() < 0.3 else box,
        num_beams=12,
        v_max=rng.uniform(0.2, 2.0),
        omega_max=rng.uniform(0.5, 4.0),
        alpha_v=10 ** rng.uniform(-0.5, 1.3),
        alpha_omega=10 ** rng.uniform(-0.3, 1.4),
        control_rate=float(rng.choice([5, 10, 20])),
        v_min=None if rng.random() < 0.7 else -0.2 * rng.random(),
    )


def random_points(rng, robot):
    """Posts, a corridor or a wall (M, 2), as far away as the robot needs to stop, and some beside its outline [m]."""
    span = (
        robot.footprint.circumscribed_radius
        + 0.2
        + min(robot.v_max * robot.dt + 0.5 * robot.v_max**2 / robot.alpha_v, 2.0)
    )
    posts = rng.uniform(-1.3 * span, 1.3 * span, (rng.integers(1, 20), 2))
    along = np.arange(-span, span, 0.05)
    kind = rng.integers(3)
    if kind == 1:
        half = robot.footprint.inscribed_radius + rng.uniform(0.01, 0.4)
        posts = np.vstack([_wall(along, half), _wall(along, -half), posts[:1]])
    if kind == 2:
        posts = np.vstack([_wall(along, rng.uniform(0.05, span)), posts[:5]])
    points = to_robot(posts, Pose(0.0, 0.0, rng.uniform(-0.5, 0.5) if kind == 1 else rng.uniform(-3.1, 3.1)))
    return np.vstack([points, *_beside(rng, robot, rng.integers(0, 3))])


def random_twist(rng, robot):
    v = rng.choice(
        [0.0, rng.uniform(max(-0.25 * robot.v_max, robot.limits.lowest), 0.0), rng.uniform(0.0, robot.v_max)]
    )
    return Twist(float(v), float(rng.choice([0.0, rng.uniform(-robot.omega_max, robot.omega_max)])))


def random_steps(make, rng, number, chain=10):
    """Drive up to `chain` steps from each of many random states, `number` in total.

    make: from a robot, latency and lag [s] to a planner with its `StoppingCheck` in `_check`.
    """
    counted = not_counted = broken = 0
    while counted < number:
        robot = random_robot(rng)
        latency, lag = DELAYS[rng.integers(len(DELAYS))]
        planner, check = make(robot, latency, lag), StoppingCheck(robot.footprint, robot.dt, latency, lag)
        points, twist = random_points(rng, robot), random_twist(rng, robot)
        sent = [random_twist(rng, robot) for _ in check.under_way]
        now = StoppingState(points, (twist,), robot.limits, sent[-1] if sent else twist)
        for each in (check, planner._check):
            each.under_way.extend(sent)
        if not check.stops(STILL, now):
            not_counted += 1
            continue
        for _ in range(chain):
            command = _asked(planner, rng, robot, now)
            check.sent(command)
            now = _a_period_later(now, [*sent, command], robot, latency, lag)
            sent = list(check.under_way)
            counted += 1
            if not check.stops(STILL, now):
                broken += 1
                break
    return Steps(counted, not_counted, broken)


def _wall(along, side):
    return np.column_stack([along, np.full(len(along), side)])


def _beside(rng, robot, number):
    """Points from 1 mm to 20 cm off one side of the outline."""
    half_length, half_width, rounding = robot.footprint.box
    for _ in range(number):
        off, side = rounding + 10 ** rng.uniform(-3.0, -0.7), rng.choice([-1, 1])
        if rng.random() < 0.5:
            yield [[rng.uniform(-half_length, half_length), side * (half_width + off)]]
        else:
            yield [[side * (half_length + off), rng.uniform(-half_width, half_width)]]


def _asked(planner, rng, robot, now):
    turn, far = rng.uniform(-math.pi, math.pi), rng.uniform(0.1, 4.0)
    subgoal = far * np.array([math.cos(turn), math.sin(turn)])
    way = np.outer([-0.4, -0.8, -1.2], subgoal / far)
    guidance = Guidance(subgoal, points=now.points, blocked=bool(rng.random() < 0.2), way=way)
    seen = observation(twist=now.twists[0], robot=robot)._replace(last_command=now.ramp_start)
    return planner.plan(seen, guidance)


def _a_period_later(now, commands, robot, latency, lag):
    """The state after a control period; commands: those under way, the oldest first, and the new one."""
    late = len(commands[1:]) * robot.dt - latency
    pieces = (
        [(commands[0], robot.dt - late), (commands[1], late)] if late > 1e-9 else [(commands[0], robot.dt)]
    )
    pose, twist = Pose(0.0, 0.0, 0.0), (*now.twists[0],)
    for command, duration in pieces:
        way, twist = oracles.followed(
            pose, twist, command, duration, (robot.limits.bounds, lag), robot.footprint
        )
        pose = Pose(*way[-1])
    return now._replace(points=to_robot(now.points, pose), twists=(Twist(*twist),), ramp_start=commands[-1])
