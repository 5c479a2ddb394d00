"""What the escaper remembers, where it thinks that lies, and that a reset forgets it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.frames import to_robot, to_world
from lme.guides.lme.maintenance import Choice
from lme.navigation.navigator import Navigator
from lme.types import Guidance, Pose, Twist
from tests.builders import (
    assert_same,
    escape,
    escaper,
    explained,
    observation,
    only,
    stage,
    wander,
)
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)


def straight(made, steps, v=0.6):
    for _ in range(steps):
        made.decide(observation(twist=Twist(v, 0.0)))
    return explained(made, observation(twist=Twist(v, 0.0))).view.history


@pytest.mark.parametrize(("settings", "length"), [({}, 8), ({"history_length": 3}, 3)])
def test_the_history_holds_the_last_k_positions(settings, length):
    # 0.6 m/s at 5 Hz: 0.12 m a period. The first decision has no past; the last position is at −0.12.
    history = straight(escaper(history_min_distance=0.0, **settings), 20)
    expected = [[-0.12 * age, 0.0] for age in range(length, 0, -1)]
    assert history == pytest.approx(np.array(expected), abs=KERNEL)


def test_history_nearer_than_r_does_not_count():
    # Of 0.12, 0.24, … 0.96 m all but the first are at least r = 0.2 m away, the last four 2.9 r = 0.58 m.
    assert len(straight(escaper(), 20)) == 7
    assert len(straight(escaper(history_min_distance=2.9), 20)) == 4
    assert len(straight(escaper(), 4)) == 3


@settings(max_examples=20)
@given(SEEDS)
def test_history_lies_where_the_robot_was(seed):
    # Turning is exact at an even ramp; UpdatePos moves along the old heading, so a period of speed v and turn
    # rate ω is off by less than v Δt · ω Δt, and k periods by no more than the sum.
    seen, poses = wander(seed=seed)
    made, dt = escaper(history_min_distance=0.0), stage().dt
    slack = [0.0]
    for now, view in enumerate(seen):
        history = explained(made, view).view.history
        if now:
            pair = [seen[now - 1].twist, view.twist]
            slack.append(max(t.v for t in pair) * max(abs(t.omega) for t in pair) * dt * dt)
        assert len(history) == min(now, 8)
        for age, point in enumerate(history[::-1], start=1):
            true = to_robot(np.array(poses[now - age][:2]), poses[now])
            assert math.dist(point, true) <= sum(slack[now - age + 1 :]) + KERNEL


@settings(max_examples=20)
@given(SEEDS)
def test_a_kept_subgoal_stays_where_it_is_in_the_world(seed):
    seen, poses = wander(seed=seed)
    made, dt, off = escaper(only(c_o=1.0)), stage().dt, 0.0
    first = to_world(made.decide(seen[0]).subgoal, poses[0])
    for before, now, pose in zip(seen, seen[1:], poses[1:], strict=False):
        decision = made.decide(now)
        assert decision.choice is Choice.KEPT
        pair = [before.twist, now.twist]
        off += max(t.v for t in pair) * max(abs(t.omega) for t in pair) * dt * dt
        assert math.dist(to_world(decision.subgoal, pose), first) <= off + KERNEL


@settings(max_examples=10)
@given(SEEDS)
def test_reset_forgets_everything(seed):
    before, after = wander(steps=12, seed=seed)[0], wander(steps=12, seed=seed + 1)[0]
    used, fresh = escaper(history_min_distance=0.0), escaper(history_min_distance=0.0)
    for view in before:
        used.decide(view)
    for made in (used, fresh):
        made.reset(np.random.default_rng(seed))
    for view in after:
        assert_same(explained(used, view), explained(fresh, view))


class Recorder:
    """A guide and a planner that write down what they are given and draw."""

    def __init__(self, draws=1):
        self.draws = draws
        self.drawn = []
        self.guidance = []

    def reset(self, rng):
        self.drawn.append(rng.random(self.draws).tolist())

    def guide(self, observation):
        return Guidance(observation.target)

    def plan(self, observation, guidance):
        self.guidance.append(guidance)
        return Twist(0.1, 0.2)


def test_a_navigator_resets_guide_and_planner_and_forgets_its_guidance():
    guide, planner = Recorder(), Recorder()
    made = Navigator(guide, planner)
    for _ in range(2):
        made.reset(np.random.default_rng(0))
        assert made.guidance is None
        assert made.act(observation()) == Twist(0.1, 0.2)
        assert made.guidance is planner.guidance[-1]
    for part in (guide, planner):
        assert len(part.drawn) == 2
        assert part.drawn[0] == part.drawn[1]
    assert guide.drawn[0] != planner.drawn[0]


def test_what_a_guide_draws_does_not_change_what_a_planner_draws():
    planners = []
    for draws in (1, 5):
        planners.append(Recorder())
        Navigator(Recorder(draws), planners[-1]).reset(np.random.default_rng(0))
    assert planners[0].drawn == planners[1].drawn


def test_odometry_is_never_read():
    seen = escape()
    blind = [observation._replace(odometry=Pose(math.nan, math.nan, math.nan)) for observation in seen]
    one, other = escaper(), escaper()
    for a, b in zip(seen, blind, strict=True):
        assert_same(one.decide(a), other.decide(b))
