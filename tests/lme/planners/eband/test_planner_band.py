"""The elastic band: it follows the path, keeps to the middle of gaps and tears where there is no way."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.eband.planner import Band
from tests.builders import stage
from tests.tolerances import KERNEL

NOTHING = np.empty((0, 2))


def band(robot=None, **settings):
    return Band(load_settings("planner/eband", **settings), (robot or stage()).footprint.inscribed_radius)


def update(made, path, robot=(0.0, 0.0), points=NOTHING, planned=True, times=1):
    for _ in range(times):
        made.update(np.array(path, dtype=float), np.array(robot, dtype=float), points, planned=planned)
    return made


def poles(*places):
    """Points all round small poles."""
    ring = 0.05 * np.column_stack(
        [f(np.linspace(0, 2 * np.pi, 12, endpoint=False)) for f in (np.cos, np.sin)]
    )
    return np.vstack([np.array(place) + ring for place in places])


def test_a_band_goes_from_the_robot_to_the_path_s_end_within_the_horizon():
    made = update(band(horizon=2.0), [(0, 0), (1, 0), (5, 0)])
    assert made.centres[0].tolist() == [0.0, 0.0]
    assert made.centres[-1] == pytest.approx((2.0, 0.0), abs=KERNEL)
    update(made, [(0, 0), (1, 0), (5, 0)], robot=(0.5, 0.1))
    assert made.centres[0].tolist() == [0.5, 0.1]
    assert made.centres[-1] == pytest.approx((2.5, 0.0), abs=KERNEL)
    update(made, [(0, 0), (1, 0), (5, 0)], robot=(4.5, 0.0))
    assert made.centres[-1].tolist() == [5.0, 0.0]
    assert not made.torn


def test_a_band_keeps_to_the_middle_of_a_gap_that_the_path_grazes():
    points = poles((1.0, 0.6), (1.0, -0.2))  # 0.7 m between them, its middle at y = 0.2
    made = update(band(), [(0, 0), (2, 0)], points=points, times=30)
    assert not made.torn
    crossing = np.interp(1.0, *made.centres.T)
    assert crossing == pytest.approx(0.2, abs=0.07)


def test_a_band_stays_where_it_is_while_the_path_wavers():
    points = poles((1.0, 0.0))
    left, right = [(0, 0), (1, 0.6), (2, 0)], [(0, 0), (1, -0.6), (2, 0)]
    made = update(band(), left, points=points, times=3)
    for path in (right, left, right, right):
        update(made, path, points=points)
        assert np.interp(1.0, *made.centres.T) > 0.3
    blocked = np.vstack([points, poles(*[(1.0, y) for y in np.arange(0.1, 1.6, 0.1)])])
    update(made, right, points=blocked)  # torn now, ...
    update(made, right, points=blocked, times=3)  # ... so the next path counts
    assert not made.torn
    assert np.interp(1.0, *made.centres.T) < -0.3


def test_a_path_to_elsewhere_is_followed_at_once():
    made = update(band(), [(0, 0), (2, 0)])
    update(made, [(0, 0), (0, 2)])
    assert made.centres[-1].tolist() == [0.0, 2.0]


def test_an_end_that_moves_a_little_takes_the_band_s_end_along():
    made = update(band(), [(0, 0), (1.5, 0)])
    for end in ([1.5, 0.03], [1.46, 0.03]):
        update(made, [(0, 0), end])
        assert made.centres[-1].tolist() == end
    update(made, [(0, 0), (1.5, 0.4)])  # within the last bubble, but elsewhere
    assert made.centres[-1].tolist() == [1.5, 0.4]


def test_bubbles_that_the_robot_has_passed_are_gone():
    points = poles(*[(x, side * 0.45) for x in np.arange(-1.0, 3.0, 0.1) for side in (-1, 1)])
    path = [(0, 0), (5, 0)]
    made = update(band(), path, points=points)
    passed = (made.centres[:, 0] > 0) & (made.centres[:, 0] < 0.95)
    assert passed.sum() >= 2
    made.centres[1:3] += (0.0, 0.01)  # not quite redundant
    update(made, path, robot=(0.97, 0.0), points=points)
    assert (made.centres[1:, 0] > 0.97).all()


def test_a_gap_too_narrow_tears_the_band_just_there():
    wall = poles(*[(1.0, y) for y in np.arange(-2, 2.01, 0.1)])
    made = update(band(), [(0, 0), (2, 0)], points=wall)
    assert made.torn
    assert 0.5 < made.centres[made.chain - 1, 0] < 0.9
