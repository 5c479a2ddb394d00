"""The filter lets through what can be stopped in time, and keeps any planner from what was seen."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.planners.safety.filter import SafetyFilter
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Pose, Twist
from lme.worlds.world import World
from tests.builders import observation, shipped, stage, task
from tests.stopping_states import random_steps

MARGIN = 0.01


class Wants:
    """Commands the same twist each time, or a random one."""

    def __init__(self, command=None, robot=None):
        self.command, self._robot = command, robot

    def reset(self, rng):
        self._rng = rng

    def plan(self, observation, guidance):
        if self.command is not None:
            return self.command
        shares = self._rng.uniform(-1.3, 1.3, 2)
        return Twist(shares[0] * self._robot.v_max, shares[1] * self._robot.omega_max)


def filtered(command, robot, **config):
    made = SafetyFilter(load_settings("filter/stopping", **config), Wants(command, robot), robot)
    made.reset(np.random.default_rng(0))
    return made


def sent(command, points, robot=None, twist=Twist(0.0, 0.0), **config):  # noqa: B008
    robot = robot or stage()
    guidance = Guidance(np.array([3.0, 0.0]), points=np.array(points, dtype=float).reshape(-1, 2))
    return filtered(command, robot, **config).plan(observation(twist=twist, robot=robot), guidance)


def test_a_command_after_which_the_robot_can_stop_passes_unchanged():
    wanted = Twist(0.4, 0.3)
    assert sent(wanted, []) == wanted
    assert sent(wanted, [[0.6, 0.0], [-0.22, 0.0]]) == wanted
    # 0.5 m/s: 0.1625 m in a period of 0.2 s and of braking, beside a radius of 0.2 m.
    assert sent(Twist(0.5, 0.0), [[0.3625 + MARGIN + 0.001, 0.0]], twist=Twist(0.5, 0.0)) == (0.5, 0.0)


def test_a_command_after_which_it_cannot_is_replaced_by_the_nearest_one():
    command = sent(Twist(0.5, 0.0), [[0.3625 + MARGIN - 0.001, 0.0]], twist=Twist(0.5, 0.0))
    assert 0.4 < command.v < 0.5
    assert command.omega == 0.0


def test_the_robot_brakes_if_nothing_else_is_left():
    assert sent(Twist(0.5, 0.0), [[0.1, 0.0], [-0.1, 0.0]]) == (0.0, 0.0)
    slower = pytest.approx((0.5 - 2.0 * 0.2, 0.0))  # by as much as the limits allow in a period
    assert sent(Twist(0.5, 0.5), [[0.25, 0.0]], twist=Twist(0.5, 0.0)) == slower


def test_a_robot_inside_the_margin_may_leave_but_not_come_nearer():
    near = [[0.205, 0.0]]
    assert sent(Twist(0.3, 0.0), near).v <= 1e-6
    assert sent(Twist(-0.3, 0.0), near) == (-0.3, 0.0)
    assert sent(Twist(0.0, 1.0), near) == pytest.approx((0.0, 0.4))  # as much as it can reach in a period


def test_known_delays_take_room():
    wanted, place = Twist(0.4, 0.0), [[0.3, 0.0]]  # 0.04 m in the period from rest, and 0.04 m of braking
    assert sent(wanted, place) == wanted
    made, robot = filtered(wanted, stage(), latency=0.2), stage()
    guidance = Guidance(np.array([3.0, 0.0]), points=np.array(place))
    assert made.plan(observation(robot=robot), guidance) == wanted
    assert made.plan(observation(robot=robot), guidance).v < 0.2
    assert sent(Twist(-0.3, 0.0), [[0.27, 0.0]], twist=Twist(0.2, 0.0), lag=0.5).v < 0.0


def test_a_robot_that_cannot_back_up_is_checked_as_it_drives():
    assert sent(Twist(-0.5, 0.0), [[-0.22, 0.0]], stage(v_min=0.0)) == (0.0, 0.0)


def test_points_in_the_blind_arc_are_remembered():
    robot = stage(fov=math.pi, num_beams=271)
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    post = World(circles=np.array([[0.0, 0.5, 0.1]]))
    seen = simulator.reset(
        task(post, start=Pose(0.0, 0.0, math.pi / 2), goal=(9, 9)), np.random.default_rng(0)
    )
    made = filtered(None, robot)
    for command in [*[Twist(0.0, 1.5)] * 11, *[Twist(-0.4, 0.0)] * 12]:
        made.planner.command = command
        seen = simulator.step(made.plan(seen, Guidance(seen.target)))
    assert not simulator.state.contact
    assert simulator.state.clearance < 0.1


def test_a_planner_that_commands_no_numbers_is_named():
    with pytest.raises(InputError, match=r"^tests\S+\.Wants\.plan returned \(nan, 0\.0\): must be"):
        sent((math.nan, 0.0), [[0.5, 0.0]])


@given(
    st.sampled_from(["jackal", "go2", "stage", "turtlebot2"]),
    st.sampled_from([(0.0, 0.0), (0.1, 0.0), (0.15, 0.0), (0.0, 0.2)]),
    st.integers(0, 10**6),
)
def test_whatever_the_planner_wants_nothing_seen_is_hit_in_the_simulator(name, delays, seed):
    rng, (latency, lag) = np.random.default_rng(seed), delays
    robot = shipped(name)
    angles, distances = rng.uniform(-math.pi, math.pi, 12), rng.uniform(0.6, 1.5, 12)
    posts = np.column_stack([distances * np.cos(angles), distances * np.sin(angles), np.full(12, 1e-6)])
    simulator = FastSimulator(load_settings("sim/fast", latency=latency, lag=lag), robot)
    seen = simulator.reset(task(World(circles=posts), goal=(9, 9)), rng)
    made = filtered(None, robot, latency=latency, lag=lag)
    for _ in range(25):
        pose = Pose(*simulator.state.pose)
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        at = (posts[:, :2] - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])
        seen = simulator.step(made.plan(seen, Guidance(seen.target, points=at)))
        assert not simulator.state.contact


def random_filter(robot, latency, lag):
    made = SafetyFilter(load_settings("filter/stopping", latency=latency, lag=lag), Wants(None, robot), robot)
    made.reset(np.random.default_rng(0))
    return made


@settings(max_examples=20)
@given(st.integers(0, 10**9))
def test_from_a_state_in_which_the_robot_can_stop_the_filter_leads_to_another_one(seed):
    assert random_steps(random_filter, np.random.default_rng(seed), 50).broken == 0


@pytest.mark.slow
def test_a_hundred_thousand_random_steps_of_the_filter_keep_the_robot_able_to_stop():
    steps = random_steps(random_filter, np.random.default_rng(0), 100_000)
    print(steps)
    assert steps.broken == 0
