import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lme.geometry.collision import sweep
from tests import oracles
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
NO_CIRCLES = np.empty((0, 3))
NO_EDGES = np.empty((0, 4))
RECTANGLE = (0.21, 0.155, 0.0)
DISC = (0.0, 0.0, 0.2)


def scene(seed):
    """A short motion among a few circles and edges: poses, box, circles, edges."""
    rng = np.random.default_rng(seed)
    steps = rng.integers(1, 9)
    part = np.linspace(0, 1, steps)[:, None]
    poses = rng.uniform(-1.5, 1.5, 3) + part * rng.uniform(-1, 1, 3)
    circles = np.column_stack([rng.uniform(-3, 3, (rng.integers(0, 7), 2))])
    circles = np.column_stack([circles, rng.uniform(0.01, 0.5, len(circles))])
    edges = rng.uniform(-3, 3, (rng.integers(0, 5), 4))
    half_length, half_width, rounding = rng.uniform(0.02, 0.4, 3)
    boxes = [(half_length, half_width, 0.0), (half_length, half_width, rounding), (0.0, 0.0, rounding)]
    return poses, boxes[rng.integers(3)], circles, edges


@settings(max_examples=150)
@given(SEEDS)
def test_equals_every_pose_against_every_obstacle(seed):
    arguments = scene(seed)
    clearance, contact = sweep(*arguments)
    expected_clearance, expected_contact = oracles.sweep(*arguments)
    assert contact == expected_contact
    assert clearance == pytest.approx(expected_clearance, abs=KERNEL)


@given(SEEDS)
def test_mirroring_everything_changes_nothing(seed):
    poses, box, circles, edges = scene(seed)
    clearance, contact = sweep(poses, box, circles, edges)
    mirrored = sweep(poses * [1, -1, -1], box, circles * [1, -1, 1], edges * [1, -1, 1, -1])
    assert mirrored == (pytest.approx(clearance, abs=KERNEL), contact)


@given(SEEDS)
def test_an_obstacle_more_never_gives_room(seed):
    poses, box, circles, edges = scene(seed)
    assume(len(circles) > 0)
    clearance, contact = sweep(poses, box, circles, edges)
    assume(contact < 0)
    assert clearance <= sweep(poses, box, circles[1:], edges)[0]


def test_an_empty_world_has_no_end():
    assert sweep(np.zeros((2, 3)), DISC, NO_CIRCLES, NO_EDGES) == (math.inf, -1)


def test_a_disc_between_two_discs():
    # Centres at 1.0 and 0.8 m, radii 0.3 and 0.2 beside the robot's 0.2: 0.5 and 0.4 m of room.
    circles = np.array([[1.0, 0.0, 0.3], [0.0, -0.8, 0.2]])
    assert sweep(np.zeros((1, 3)), DISC, circles, NO_EDGES) == (pytest.approx(0.4, abs=KERNEL), -1)


def test_a_rectangle_turns_its_corner_into_a_cylinder():
    # The corner sweeps a circle of radius hypot(0.21, 0.155) = 0.2610; the cylinder begins at 0.25 on the
    # bearing of the corner at 45°: 0.7854 − atan2(0.155, 0.21) = 0.1495 rad of turning away.
    circles = np.array([[0.3 * math.cos(math.pi / 4), 0.3 * math.sin(math.pi / 4), 0.05]])
    turning = np.column_stack([np.zeros((16, 2)), np.arange(16) * 0.01])
    clearance, contact = sweep(turning, RECTANGLE, circles, NO_EDGES)
    assert clearance == 0.0
    assert 0 < contact <= 15
    assert sweep(turning[:contact], RECTANGLE, circles, NO_EDGES)[1] == -1


def test_first_contact_ends_the_search():
    driving = np.column_stack([np.linspace(0, 2, 21), np.zeros((21, 2))])
    circles = np.array([[1.05, 0.0, 0.1]])  # reached by the front once x ≥ 1.05 − 0.1 − 0.21 = 0.74
    assert sweep(driving, RECTANGLE, circles, NO_EDGES) == (0.0, 8)


def test_touching_is_contact():
    assert sweep(np.zeros((1, 3)), (0.25, 0.25, 0.0), np.array([[0.5, 0.0, 0.25]]), NO_EDGES) == (0.0, 0)
    assert sweep(np.zeros((1, 3)), (0.25, 0.25, 0.0), NO_CIRCLES, np.array([[0.25, -1, 0.25, 1]])) == (0.0, 0)


@pytest.mark.parametrize(
    ("edge", "clearance"),
    [
        ([-1.0, 0.1, 1.0, 0.1], 0.0),  # right through
        ([0.0, 0.0, 0.1, 0.05], 0.0),  # all of it inside
        ([-1.0, 0.255, 1.0, 0.255], 0.1),  # beside
        ([0.51, 0.0, 2.0, 0.0], 0.3),  # its end ahead
        ([0.51, 0.555, 0.51, 0.555], 0.5),  # a point off the corner, 0.3 and 0.4 away
    ],
)
def test_a_rectangle_and_an_edge(edge, clearance):
    found = sweep(np.zeros((1, 3)), RECTANGLE, NO_CIRCLES, np.array([edge]))
    assert found == (pytest.approx(clearance, abs=KERNEL), 0 if clearance == 0 else -1)
