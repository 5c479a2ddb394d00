"""Algorithm 1 step by step: what it sees, what it keeps, and that it changes nothing behind one's back."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.guides.lme.guide import Lme
from lme.guides.lme.maintenance import Choice
from lme.guides.lme.surmount import find_blockage
from lme.navigation.episode import run_episode
from lme.robots import Lidar
from lme.simulation.fast import FastSimulator
from lme.worlds.world import World
from tests.builders import (
    PUBLISHED,
    assert_same,
    escape,
    escaper,
    explained,
    inject,
    navigator,
    observation,
    only,
    room,
    stage,
    task,
)
from tests.tolerances import KERNEL


def returns(robot, ranges):
    """A scan with these {beam: range [m]} and no other return."""
    scan = np.full(robot.lidar.num_beams, robot.lidar.range_max, dtype=np.float32)
    scan[list(ranges)] = list(ranges.values())
    return scan


# --- what it sees ----------------------------------------------------------------------------------------


def test_scan_points_are_where_the_mounted_lidar_hits():
    # Lidar at (0.3, −0.1), turned left by 90°; its beam 90 of 181 over 180° points along its own x axis.
    # 2 m along it: (0.3, −0.1 + 2) = (0.3, 1.9).
    lidar = Lidar(num_beams=181, fov=math.pi, range_min=0.02, range_max=15.0, x=0.3, y=-0.1, yaw=math.pi / 2)
    robot = stage(lidar=lidar)
    seen = explained(escaper(robot=robot), observation(ranges=returns(robot, {90: 2.0}), robot=robot))
    assert seen.view.points[0] == pytest.approx([0.3, 1.9], abs=KERNEL)


@pytest.mark.parametrize(("off_m", "blocks"), [(0.19, True), (0.21, False)])
@pytest.mark.parametrize("rule", ["corridor", "line_of_sight"])
@pytest.mark.parametrize("side", [1, -1])
def test_obstacles_within_r_of_the_way_to_the_target_block_it(off_m, blocks, rule, side):
    # Beam 300 of 540 points to (300 − 270)·2/3° = 20°. A return there at 2 m lies 2 sin δ off the target's ray.
    robot = stage()
    bearing = math.radians(20.0) + side * math.asin(off_m / 2.0)
    target = (4.0 * math.cos(bearing), 4.0 * math.sin(bearing))
    seen = explained(escaper(blocking=rule), observation(target, returns(robot, {300: 2.0})))
    assert (seen.view.blockage is not None) == blocks
    if blocks:
        # B lies r = 0.2 m beyond the only point.
        assert np.hypot(*seen.view.blockage.B) == pytest.approx(2.2, abs=1e-6)


def test_the_blocking_rules_differ_where_the_ray_passes_between_points():
    # Target straight ahead at 4 m. (2, 0.15) lies in the corridor; (5, 0.01), beyond the target, is the
    # nearest to the ray in angle: the line of sight is free.
    points, target = np.array([[5.0, 0.01], [2.0, 0.15]]), np.array([4.0, 0.0])
    assert find_blockage(points, target, 0.2, True, "corridor").A.tolist() == [2.0, 0.15]
    assert find_blockage(points, target, 0.2, True, "line_of_sight") is None


def test_line_of_sight_looks_ahead_only():
    behind = np.array([[-1.0, 0.0]])
    assert find_blockage(behind, np.array([4.0, 0.0]), 0.2, True, "line_of_sight") is None
    assert find_blockage(np.empty((0, 2)), np.array([4.0, 0.0]), 0.2, True, "line_of_sight") is None


def test_sectors_join_points_nearer_than_two_r():
    # 2r = 0.4 m. Beams 2/3° apart at 10 m: 0.116 m per beam; 3 beams 0.349 m join, 4 beams 0.465 m do not.
    scan = returns(stage(), dict.fromkeys((300, 303, 307), 10.0))
    assert explained(escaper(), observation(ranges=scan)).sectors.tolist() == [[0, 1], [2, 2]]


# --- what it keeps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "choice"),
    [
        # a_close alone, target 8 m ahead: a gain of so many m. d1 = 0.5 m, d2 = 1.
        ((2.0, 0.0), (2.9, 0.0), Choice.KEPT),
        ((2.0, 0.0), (3.1, 0.0), Choice.BETTER),
        ((0.9, 0.0), (1.0, 0.0), Choice.KEPT),  # between d1 and d2
        ((0.4, 0.0), (0.5, 0.0), Choice.REACHED),
        ((0.4, 0.0), (0.2, 0.0), Choice.REACHED),  # even for a worse one
    ],
)
def test_the_old_subgoal_stands_unless_reached_or_clearly_beaten(monkeypatch, old, new, choice):
    inject(monkeypatch, [old], [new])
    made = escaper(only(a_close=1.0, d1=0.5, d2=1.0))
    assert made.decide(observation(target=(8.0, 0.0))).choice is Choice.FIRST
    decision = made.decide(observation(target=(8.0, 0.0)))
    assert decision.choice is choice
    assert decision.subgoal.tolist() == list(old if choice is Choice.KEPT else new)


def test_the_guide_passes_on_switches_and_blocked_ways():
    guide = Lme(load_settings("guide/lme", parameters={**PUBLISHED, "d1": math.inf}), stage())
    assert not guide.guide(observation()).switched
    assert guide.guide(observation()).switched
    closed = guide.guide(observation(ranges=np.full(540, 0.15, dtype=np.float32)))
    assert closed.blocked
    assert not guide.guide(observation()).blocked


def test_steps_without_a_free_candidate_are_counted():
    # Walls 0.22 m away: within r = 0.25 of the robot itself, so nothing is free at any step.
    robot = stage(collision_radius=0.25)
    boxed, empty = (
        run_episode(
            task(world, time_limit=2.0),
            navigator(robot),
            FastSimulator(load_settings("sim/fast"), robot),
            np.random.default_rng(0),
        )
        for world in (room(0.44), World())
    )
    assert boxed.no_free_candidate == boxed.steps > 0
    assert empty.no_free_candidate == 0


# --- what it never changes -------------------------------------------------------------------------------


@pytest.mark.parametrize("explains", [1, 3])
def test_explaining_changes_nothing_and_is_of_the_last_decision(explains):
    quiet, asked = escaper(), escaper()
    for view in escape():
        decision = asked.decide(view)
        explanations = [asked.explanation() for _ in range(explains)]
        assert_same(decision, quiet.decide(view))
        for explanation in explanations:
            assert_same(explanation.decision, decision)
            np.testing.assert_array_equal(explanation.view.target, view.target)


def test_there_is_nothing_to_explain_before_the_first_decision():
    made = escaper()
    assert made.explanation() is None
    made.decide(escape()[0])
    made.reset(np.random.default_rng(0))
    assert made.explanation() is None


def test_a_returned_decision_may_be_written_to():
    untouched, scribbled = escaper(history_min_distance=0.0), escaper(history_min_distance=0.0)
    for view in escape():
        decision = scribbled.decide(view)
        assert_same(decision, untouched.decide(view))
        explanation = scribbled.explanation()
        for values in (
            decision.subgoal,
            explanation.candidates,
            explanation.features,
            explanation.view.history,
        ):
            values[:] = 99.0
        if explanation.old is not None:
            explanation.old[:] = 99.0


def test_the_observation_is_left_as_it_was():
    made = escaper()
    for view in escape(steps=5):
        ranges, target = view.scan.ranges.copy(), view.target.copy()
        made.decide(view)
        np.testing.assert_array_equal(view.scan.ranges, ranges)
        np.testing.assert_array_equal(view.target, target)
