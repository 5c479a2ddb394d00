"""Arcs: the first contact of a footprint that keeps its velocity, against a twin that creeps up to it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.arcs import SLACK, clearances, first_contacts
from tests.tolerances import KERNEL

JACKAL = (0.21, 0.155, 0.0)
DISC = (0.0, 0.0, 0.2)
BOXES = st.sampled_from([JACKAL, DISC, (0.35, 0.155, 0.0), (0.3, 0.0, 0.1), (0.0, 0.2, 0.1)])
HAIR = (
    1e-7  # [m] by which a footprint is shrunk and grown to bracket a contact: grazing is a matter of rounding
)


def seen_at(time, twist, point):
    """The point in the robot frame after `time` at `twist`."""
    v, omega = twist
    yaw = omega * time
    if omega == 0.0:
        x, y = v * time, 0.0
    else:
        x, y = v / omega * math.sin(yaw), v / omega * 2.0 * math.sin(yaw / 2) ** 2
    dx, dy = point[0] - x, point[1] - y
    return math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx


def distance(point, box):
    """From the footprint, as it stands at the origin."""
    return math.hypot(max(abs(point[0]) - box[0], 0.0), max(abs(point[1]) - box[1], 0.0)) - box[2]


def contact_time(twist, point, box, margin, horizon):
    """Advance by as long as the point cannot bridge its distance in; it moves at one speed on its circle."""
    gap = distance(point, box)
    if gap <= 0.0:
        return 0.0
    box = (box[0], box[1], box[2] + min(margin, SLACK * gap))
    v, omega = twist
    speed = max(math.hypot(omega * point[0], v - omega * point[1]), 1e-12)
    horizon = min(horizon, 2 * math.pi / abs(omega) if omega else horizon)
    time = 0.0
    while time <= horizon:
        gap = distance(seen_at(time, twist, point), box)
        if gap <= 0.0:
            return time
        time += max(gap / speed, 1e-9)
    return math.inf


def shrunk(box, by):
    """The box with every piece smaller by `by`; negative: larger."""
    return tuple(size - by if size > 0.0 else 0.0 for size in box)


@st.composite
def twists(draw):
    """Arcs to both sides, straight ahead, nearly so, and turns in place."""
    v = draw(st.sampled_from([0.0, 0.05, 0.3, 1.0, 2.0]))
    omega = draw(st.sampled_from([0.0, 1e-5, 0.01]) | st.floats(0.05, 4.0)) * draw(st.sampled_from([-1, 1]))
    return (v, omega) if v or omega else (0.3, 0.0)


POINTS = st.tuples(st.floats(0.02, 3.0), st.floats(-math.pi, math.pi)).map(
    lambda polar: (polar[0] * math.cos(polar[1]), polar[0] * math.sin(polar[1]))
)


def times(some_twists, points, box, margin=0.0, least=0.0, horizon=8.0):
    some_twists, points = (np.array(pairs, dtype=float).reshape(-1, 2) for pairs in (some_twists, points))
    margins, leasts, horizons = (
        np.full(len(some_twists), float(value)) for value in (margin, least, horizon)
    )
    return first_contacts(some_twists, points, box, margins, leasts, horizons)


@settings(max_examples=150)
@given(twists(), POINTS, BOXES, st.sampled_from([0.0, 0.1, 0.5]))
def test_contact_is_where_the_twin_meets_it(twist, point, box, margin):
    found = times([twist], [point], box, margin)[0]
    early = contact_time(twist, point, shrunk(box, -HAIR), margin, 8.0 + HAIR)
    late = contact_time(twist, point, shrunk(box, HAIR), margin, 8.0)
    assert early - 1e-6 <= found <= late + 1e-6
    if late - early < 1e-5:
        assert found == pytest.approx(late, abs=1e-5)


@given(st.lists(twists(), min_size=1, max_size=5), st.lists(POINTS, max_size=12), BOXES)
def test_the_first_of_many_points_counts(some_twists, points, box):
    together = times(some_twists, points, box, 0.05)
    alone = [times(some_twists, [point], box, 0.05) for point in points]
    expected = np.min(alone, axis=0) if points else np.full(len(some_twists), np.inf)
    np.testing.assert_allclose(together, expected, rtol=0, atol=KERNEL)


@given(st.lists(twists(), min_size=1, max_size=5), st.lists(POINTS, max_size=12), BOXES, st.floats(0.0, 4.0))
def test_a_contact_too_early_is_not_looked_into(some_twists, points, box, least):
    exact, found = (times(some_twists, points, box, 0.05, value) for value in (0.0, least))
    early = exact < least
    assert (found[early] < least).all()
    np.testing.assert_array_equal(found[~early], exact[~early])


@given(st.lists(twists(), min_size=1, max_size=5), st.lists(POINTS, max_size=8), BOXES)
def test_a_mirrored_scene_is_met_at_the_same_time(some_twists, points, box):
    mirrored = [(x, -y) for x, y in reversed(points)]
    other = times([(v, -omega) for v, omega in some_twists], mirrored, box, 0.05)
    np.testing.assert_array_equal(other, times(some_twists, points, box, 0.05))


def test_a_point_straight_ahead_is_met_by_hand():
    # 1 m ahead of a front at 0.21: 0.79 m at 0.5 m/s. Beside by more than half the width: never.
    assert times([(0.5, 0.0)], [(1.0, 0.1)], JACKAL)[0] == pytest.approx(1.58, abs=KERNEL)
    assert times([(0.5, 0.0)], [(1.0, 0.156)], JACKAL)[0] == math.inf
    assert times([(0.5, 0.0)], [(-1.0, 0.0)], JACKAL)[0] == math.inf
    assert times([(0.5, 0.0)], [(1.0, 0.156)], JACKAL, margin=0.01)[0] < math.inf


def test_a_turn_in_place_sweeps_the_corners():
    # A point 0.2 m to the side, 4.5 cm off: the left side y = .155 reaches it where x = √(.2² − .155²) = .126 m.
    expected = math.pi / 2 - math.atan2(0.155, math.sqrt(0.2**2 - 0.155**2))
    assert times([(0.0, 1.0)], [(0.0, 0.2)], JACKAL)[0] == pytest.approx(expected, abs=KERNEL)
    assert times([(0.0, -2.0)], [(0.0, 0.2)], JACKAL)[0] == pytest.approx(expected / 2, abs=KERNEL)
    assert times([(0.0, 1.0)], [(0.0, 0.262)], JACKAL)[0] == math.inf  # corners reach .261 m
    assert times([(0.0, 1.0)], [(0.0, 0.201)], DISC)[0] == math.inf


def test_standing_still_touches_nothing_and_a_point_inside_is_touched_at_once():
    assert times([(0.0, 0.0)], [(0.1, 0.1)], JACKAL)[0] == math.inf
    assert times([(0.3, 0.0), (0.3, 1.0), (0.0, 1.0)], [(0.1, 0.1)], JACKAL).tolist() == [0.0, 0.0, 0.0]


def test_a_contact_after_the_horizon_is_none():
    assert times([(0.5, 0.0)], [(1.0, 0.0)], JACKAL, horizon=1.59)[0] == pytest.approx(1.58, abs=KERNEL)
    assert times([(0.5, 0.0)], [(1.0, 0.0)], JACKAL, horizon=1.57)[0] == math.inf


def test_inside_its_margin_the_robot_may_leave_a_point_but_not_come_nearer():
    # 5 cm off the left side, ahead of the middle: turning left the side comes at it, turning right it goes.
    point, margin = [(0.15, 0.205)], 0.2
    assert times([(0.5, 1.0)], point, JACKAL, margin)[0] < 0.1
    assert times([(0.5, 0.0)], point, JACKAL, margin)[0] == math.inf
    assert times([(0.5, -0.2)], point, JACKAL, margin)[0] > 0.3


def test_clearances_of_a_rectangle_and_a_disc():
    points = np.array([[0.51, 0.0], [0.51, 0.555], [0.0, 0.0]])
    np.testing.assert_allclose(clearances(points, JACKAL), [0.3, 0.5, 0.0], atol=KERNEL)
    np.testing.assert_allclose(clearances(points[:1], DISC), [0.31], atol=KERNEL)


@given(st.lists(twists(), min_size=1, max_size=5), st.lists(POINTS, max_size=12), BOXES)
def test_without_a_slack_first_contacts_keeps_the_shipped_one(some_twists, points, box):
    given_ = np.array(some_twists), np.array(points, dtype=float).reshape(-1, 2)
    leasts, horizons, margins = (np.full(len(some_twists), value) for value in (0.0, 8.0, 0.3))
    found = first_contacts(*given_, box, margins, leasts, horizons)
    np.testing.assert_array_equal(found, first_contacts(*given_, box, margins, leasts, horizons, SLACK))


@pytest.mark.parametrize("slack", [0.5, SLACK, 0.98])
def test_a_point_inside_the_margin_keeps_its_share_of_the_distance(slack):
    # 10 cm ahead of the front, with a margin of 20 cm: the robot may drive until `slack` of the 10 cm are left.
    found = first_contacts(
        np.array([[0.5, 0.0]]), np.array([[0.31, 0.0]]), JACKAL, *np.array([[0.2], [0.0], [8.0]]), slack
    )
    assert found[0] == pytest.approx(0.1 * (1.0 - slack) / 0.5, abs=KERNEL)
