"""What is known of the surroundings out of view."""

import numpy as np

from lme.planners.motion_tubes.planner import Surroundings
from lme.planners.motion_tubes.tubes import backward_tubes
from lme.types import Pose
from tests.lme.planners.motion_tubes.scenes import JACKAL, NONE, spec_of, view_of
from tests.tolerances import RANGE


def test_space_behind_the_robot_is_free_only_where_it_was_seen():
    around = Surroundings(JACKAL.footprint, 5, 0.1, 0.3)
    view, seen = view_of(JACKAL, np.empty((0, 3)))
    samples = backward_tubes(spec_of(JACKAL, length=0.25)).samples
    around.see(Pose(0.0, 0.0, 0.0), view, seen, NONE)
    assert not around.known_free(samples).all()  # 270° of view
    for x in (0.3, 0.6, 0.9):
        around.see(Pose(x, 0.0, 0.0), view, seen, NONE)
    assert around.known_free(samples).all()
    around.forget()
    around.see(Pose(0.9, 0.0, 0.0), view, seen, NONE)
    assert not around.known_free(samples).all()


def test_the_oldest_scans_give_way_and_a_resting_robot_adds_none():
    around = Surroundings(JACKAL.footprint, 3, 0.1, 0.3)
    view, seen = view_of(JACKAL, np.empty((0, 3)))
    behind = np.array([[-0.35, 0.0]])
    for x in (0.0, 0.2, 0.2, 0.2, 0.2, 0.2):
        around.see(Pose(x, 0.0, 0.0), view, seen, NONE)
    assert around.known_free(behind)[0]  # from 0, where it stood
    for x in (0.4, 0.6, 0.8, 1.0):
        around.see(Pose(x, 0.0, 0.0), view, seen, NONE)
    assert not around.known_free(behind - (0.8, 0.0))[0]


def test_a_hit_is_remembered_where_the_lidar_cannot_see_it_now():
    post = np.array([[0.5, 0.4, 0.075]])
    around = Surroundings(JACKAL.footprint, 5, 0.1, 0.3)
    for x in (0.0, 0.4, 1.0):
        view, seen = view_of(JACKAL, post - (x, 0.0, 0.0))
        hit = np.isfinite(seen)
        angles = view.first + view.increment * np.flatnonzero(hit)
        points = np.column_stack((view.x + seen[hit] * np.cos(angles), view.y + seen[hit] * np.sin(angles)))
        around.see(Pose(x, 0.0, 0.0), view, seen, points)
        hidden = around.hidden_hits(1.0)
    assert len(points) == 0  # in the blind arc now
    assert len(hidden) > 5
    np.testing.assert_allclose(np.hypot(*(hidden - (-0.5, 0.4)).T), 0.075, atol=RANGE)
