"""Scenes worked out by hand: what the policy must answer where paper and pencil give the answer."""

import math

import numpy as np
import pytest

from lme.guides.lme import criteria
from lme.guides.lme.criteria import View
from lme.guides.lme.maintenance import Choice, choose, update_position
from lme.guides.lme.surmount import cluster, find_blockage
from lme.types import Twist
from tests.builders import escaper, explained, observation, stage
from tests.tolerances import KERNEL

R = 0.2


def view(points=(), target=(4.0, 0.0), history=(), full_circle=True, surmount="every"):
    points = np.array(points, dtype=float).reshape(-1, 2)
    target = np.array(target, dtype=float)
    blockage = find_blockage(points, target, R, full_circle, "corridor")
    return View(points, target, R, np.array(history, dtype=float).reshape(-1, 2), blockage, surmount)


def at(*candidates):
    return np.array(candidates, dtype=float)


def wall():
    """x = 2, y from −0.5 to 1.0, a point every 0.1 m, in order of bearing."""
    return [(2.0, -0.5 + 0.1 * i) for i in range(16)]


def test_1_a_close_is_minus_the_distance_to_the_target():
    # 3-4-5 triangle; and the target itself.
    values = criteria.a_close(at((0, 4), (3, 0)), view(target=(3, 0)))
    assert values == pytest.approx([-5.0, 0.0], abs=KERNEL)


def test_2_a_dev_is_minus_the_wrapped_bearing():
    # left: 90°. behind: 180°, from either side. ahead to the right: 45°.
    values = criteria.a_dev(at((0, 1), (-1, 0), (-1, -1e-12), (1, -1)), view())
    assert values == pytest.approx([-math.pi / 2, -math.pi, -math.pi, -math.pi / 4], abs=1e-9)


def test_3_c_o_asks_for_r_along_the_way_to_the_candidate():
    # One point at (2, 0.1), r = 0.2.
    # (3, 0): passes it at 0.1 → blocked. (3, 2): line 2x − 3y = 0, |4 − 0.3|/√13 = 1.03 → free.
    # (1.80, 0): ends √(0.2² + 0.1²) = 0.224 away → free. (1.85, 0): √(0.15² + 0.1²) = 0.180 → blocked.
    values = criteria.c_o(at((3, 0), (3, 2), (1.80, 0), (1.85, 0)), view([(2, 0.1)]))
    assert values.tolist() == [0, 1, 1, 0]


def test_4_c_t_asks_for_r_from_the_candidate_to_the_target():
    # Point (2, 0.1), target (4, 0), r = 0.2.
    # (1, 0): passes at 0.1 → blocked. (3, 0): is past it, 1.005 away → free.
    # (0, 2): line x + 2y = 4, |2 + 0.2 − 4|/√5 = 0.805 → free.
    values = criteria.c_t(at((1, 0), (3, 0), (0, 2)), view([(2, 0.1)]))
    assert values.tolist() == [0, 1, 1]


def test_5_a_mount_leads_around_the_nearer_end_of_the_wall():
    # E1 = (2, −0.5) at −14.04°, E2 = (2, 1) at 26.57°; T straight ahead, so A = E1, |OA| = 2.06155.
    # B = A · (1 + 0.2/2.06155) = (2.19403, −0.54851).
    # (1, 0): −√(1.19403² + 0.54851²) = −1.31399. (3, −1): −√(0.80597² + 0.45149²) = −0.92382.
    scene = view(wall())
    assert scene.blockage is not None
    assert scene.blockage.E1 == pytest.approx([2.0, -0.5])
    assert scene.blockage.E2 == pytest.approx([2.0, 1.0])
    assert scene.blockage.A == pytest.approx([2.0, -0.5])
    assert scene.blockage.B == pytest.approx([2.19403, -0.54851], abs=1e-5)
    assert criteria.a_mount(at((1, 0), (3, -1)), scene) == pytest.approx([-1.31399, -0.92382], abs=1e-4)


def test_5_as_printed_a_mount_is_0_for_a_candidate_that_sees_the_target():
    # The same wall. It hides T from (1, 0), as before; (3, −1) is past it.
    scene = view(wall(), surmount="hidden")
    assert criteria.a_mount(at((1, 0), (3, -1)), scene) == pytest.approx([-1.31399, 0.0], abs=1e-4)


@pytest.mark.parametrize("surmount", criteria.SURMOUNT)
def test_5_a_mount_is_0_where_nothing_blocks_the_robot(surmount):
    # T is at (4, −2): the segment to it passes the wall's end (2, −0.5) at |2·(−2) + 4·0.5|/√20 = 0.447 > r. The
    # wall hides T from (1, 1.5), which counts for nothing: the robot's own way is free.
    scene = view(wall(), target=(4, -2), surmount=surmount)
    assert scene.blockage is None
    assert criteria.c_t(at((1, 1.5)), scene).tolist() == [0]
    assert criteria.a_mount(at((1, 1.5), (3, -1)), scene).tolist() == [0, 0]


def test_6_c_h_treats_recent_positions_as_obstacles():
    # Was 1 m behind: (−2, 0) runs over it, (2, 0) does not, (−2, 1) passes 1/√5 = 0.447 away.
    values = criteria.c_h(at((-2, 0), (2, 0), (-2, 1)), view(history=[(-1, 0)]))
    assert values.tolist() == [0, 1, 1]


def test_7_clustering_joins_across_plus_minus_pi():
    # Bearings −175°, 0°, 175° at 1 m: the outer two are 2 sin 5° = 0.174 < 0.4 apart, behind the robot.
    points = at(*[(math.cos(a), math.sin(a)) for a in np.radians([-175, 0, 175])])
    sectors, closed = cluster(points, 2 * R, True)
    assert sectors.tolist() == [[1, 1], [2, 0]]
    assert not closed


def test_8_nothing_is_joined_across_a_blind_arc():
    # The same three points seen by a lidar that is blind behind: three obstacles.
    points = at(*[(math.cos(a), math.sin(a)) for a in np.radians([-175, 0, 175])])
    sectors, closed = cluster(points, 2 * R, False)
    assert sectors.tolist() == [[0, 0], [1, 1], [2, 2]]
    assert not closed


def test_9_update_position_while_driving_and_turning():
    # v 0.4 → 0.6, ω 0 → 0.5, Δt 0.2: forward 0.5·0.2 = 0.1, turned 0.25·0.2 = 0.05 rad.
    # (2, 0) → (1.9, 0) → 1.9·(cos 0.05, −sin 0.05) = (1.897625, −0.094960).
    moved = update_position(at((2.0, 0.0)), Twist(0.4, 0.0), Twist(0.6, 0.5), 0.2)
    assert moved[0] == pytest.approx([1.897625, -0.094960], abs=1e-6)


def test_10_an_empty_scan_leaves_every_c_favourable():
    seen = explained(escaper(), observation(target=(8.0, 0.0)))
    rows = dict(zip(seen.names, seen.features, strict=True))
    assert seen.view.points.shape == (0, 2)
    assert seen.sectors.shape == (0, 2)
    for name in ("c_o", "c_t", "c_h"):
        assert rows[name].all()
    assert not rows["a_mount"].any()
    # T is 8 m off, out of the 5 m range: 300 random candidates, the best lies ahead of the robot.
    assert seen.candidates.shape == (300, 2)
    assert seen.decision.subgoal[0] > 4.0
    assert abs(seen.decision.subgoal[1]) < 1.0


def test_11_everything_blocked_still_answers_and_says_so():
    # A ring of points 0.15 m around a robot of r = 0.2: nothing is reachable, and no end to go around.
    seen = explained(escaper(), observation(ranges=np.full(540, 0.15, dtype=np.float32)))
    assert seen.closed
    assert seen.decision.blocked
    assert seen.view.blockage is None
    assert not seen.features[seen.names.index("c_o")].any()
    assert seen.decision.subgoal.tolist() == seen.candidates[np.argmax(seen.scores)].tolist()


def test_12_a_target_behind_is_a_candidate_only_where_the_lidar_sees():
    # T 3 m behind. All round: 301 candidates, T the last; 270°: T lies in the blind arc, 300.
    behind = (-3.0, 0.0)
    around = explained(escaper(), observation(target=behind))
    assert around.candidates.shape == (301, 2)
    assert around.candidates[-1].tolist() == list(behind)
    # Its score: w1·0 − w2·π + w3 + w4 + 0 + w6 = −4.9009 + 999.8 + 205.84 + 134.9 = 1335.639.
    assert around.scores[-1] == pytest.approx(1335.639, abs=1e-3)
    narrow = stage(fov=1.5 * math.pi)
    seen = explained(escaper(robot=narrow), observation(target=behind, robot=narrow))
    assert seen.candidates.shape == (300, 2)
    assert np.abs(np.arctan2(seen.candidates[:, 1], seen.candidates[:, 0])).max() <= 0.75 * math.pi


def test_13_a_target_at_0_3_m_is_the_subgoal():
    # Straight ahead: a_close = a_dev = 0, the maximum of both; all c favourable. Nothing scores higher.
    seen = explained(escaper(), observation(target=(0.3, 0.0)))
    assert seen.decision.subgoal.tolist() == [0.3, 0.0]


@pytest.mark.parametrize(
    ("distance", "gain", "choice"),
    [
        (0.50, 0.0, Choice.REACHED),  # 0.50 < d1 = 0.51
        (0.52, 200.0, Choice.KEPT),  # d2 = 200 must be exceeded
        (0.52, 200.1, Choice.BETTER),
    ],
)
def test_14_maintenance_switches_when_reached_or_clearly_beaten(distance, gain, choice):
    assert choose(distance, 1000.0, 1000.0 + gain, 0.51, 200.0) is choice


def test_15_no_maintenance_is_an_infinite_d1():
    assert choose(1e9, 1000.0, 0.0, math.inf, 200.0).switched


def test_history_within_r_is_left_out():
    # One period of standing still leaves the last position at the origin: it must not forbid every way.
    made = escaper()
    for _ in range(3):
        made.decide(observation())
    seen = explained(made, observation())
    assert seen.view.history.shape == (0, 2)
