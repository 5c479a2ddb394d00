"""Labels of walking people: where they must be in a made recording, and what they say of the real ones."""

import math

import numpy as np
import pytest

from benchmarks.people.labels import Recording, labels, read
from tests.places import SHARED

LEGS = SHARED / "bags" / "legs"
BEAMS, PERIOD, WALL = 720, 0.1, 6.0
ANGLES = -math.pi / 2 + math.pi / BEAMS * np.arange(BEAMS)


def recording(places):
    """What a scanner at the origin sees of a person of radius 0.25 m at places (T, 2), before a wall at 6 m."""
    towards = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    scans = []
    for place in places:
        along, across = towards @ place, towards[:, 0] * place[1] - towards[:, 1] * place[0]
        hit = (np.abs(across) < 0.25) & (along > 0.0)
        near = along - np.sqrt(np.where(hit, 0.25**2 - across**2, 0.0))
        scans.append(np.where(hit, np.minimum(near, WALL), WALL))
    times = PERIOD * np.arange(len(places))
    return Recording(times, np.array(scans), float(ANGLES[0]), math.pi / BEAMS, 10.0)


def test_somebody_who_walks_across_is_one_person_with_their_velocity():
    places = np.column_stack([np.full(50, 3.0), np.linspace(-2.0, 2.0, 50)])
    found = labels(recording(places))
    assert found.walking.all()
    assert set(found.person) == {0}
    np.testing.assert_array_equal(found.scan, np.arange(50))
    assert np.abs(found.place - places).max() < 0.25  # of the side that is seen
    np.testing.assert_allclose(found.velocity[:, 1], 4.0 / 49 / PERIOD, atol=0.08)


def test_somebody_who_stands_is_not_scored():
    places = np.vstack([np.tile([3.0, 1.0], (10, 1)), np.tile([40.0, 40.0], (60, 1))])
    found = labels(recording(places))
    assert len(found.scan) == 10
    assert not found.walking.any()


def test_what_never_moves_is_background():
    assert not len(labels(recording(np.tile([3.0, 1.0], (30, 1)))).scan)


@pytest.mark.skipif(not LEGS.exists(), reason="needs the recordings in ../shared/bags/legs")
@pytest.mark.parametrize(("number", "walking", "people"), [(1, 395, 4), (4, 184, 6)])
def test_the_labels_of_real_recordings(number, walking, people):
    found = labels(read(LEGS / f"positive_{number}.bag"))
    assert found.walking.sum() == walking
    assert len(set(found.person[found.walking])) == people
    speeds = np.hypot(*found.velocity[found.walking].T)
    assert 0.4 < np.median(speeds) < 1.6  # as people walk
