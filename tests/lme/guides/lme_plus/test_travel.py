"""Expected times about a robot: near in the open, longer round obstacles, and finite everywhere."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.geometry.frames import to_world
from lme.guides.lme_plus.travel import BEYOND, Travel
from lme.guides.lme_plus.travel_grid import cost_to_go_at
from lme.types import Pose
from tests.builders import stage
from tests.tolerances import ARRIVAL_CELLS, ARRIVAL_SHARE

NOTHING, HERE = np.empty((0, 2)), np.array([3.0, -7.0])
CONFIG = load_settings("guide/lme_plus").travel
BEYOND_DOOR = HERE + np.array([4.0, 0.0])


def field(points=NOTHING, target=(5.0, -7.0), reach=8.0, margin=0.08):
    return Travel(CONFIG, stage(), reach, margin).field(points, np.array(target), HERE)


def cost_to_go(field, positions):
    """T at (N, 2) positions [s]."""
    ends = field.robot_time, BEYOND, field.here, field.target, field.v_max
    return cost_to_go_at(field.times, positions, (0.0, 0.0, 0.0), (*field.grid,), *ends)


def near(time):
    return ARRIVAL_SHARE * time + ARRIVAL_CELLS * 0.15 / stage().v_max


@pytest.mark.parametrize("target", [(5.0, -7.0), (3.0, -1.0), (40.0, 20.0)])
def test_in_the_open_the_rest_is_the_straight_way(target):
    found = field(target=target)
    straight = math.hypot(target[0] - 3.0, target[1] + 7.0) / stage().v_max
    assert cost_to_go(found, HERE[None])[0] == pytest.approx(straight, abs=near(straight))


def test_where_the_search_did_not_reach_the_rest_is_its_lower_bound():
    found = field()
    far = HERE + np.array([[-6.0, 0.0], [0.0, 6.0], [100.0, 0.0]])
    assert cost_to_go(found, far[:2]) == pytest.approx(max(found.robot_time + BEYOND - 12.0, 0.0))
    assert np.isfinite(cost_to_go(found, far)).all()


def test_without_a_way_the_rest_is_the_time_of_the_straight_line():
    turn = np.linspace(0.0, 2 * math.pi, 200)
    found = field(HERE + np.column_stack((np.cos(turn), np.sin(turn))))
    assert math.isinf(found.robot_time)
    inside = HERE + np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])
    assert cost_to_go(found, inside) == pytest.approx([4.0, 3.0, math.hypot(2.0, 0.5) / 0.5])


def test_the_way_down_ends_at_the_target():
    pose = Pose(*HERE, 0.4)
    places, ahead = field().descent(pose, 8.0)
    way = to_world(places, pose)
    assert ahead == math.inf
    assert np.hypot(*(way[-1] - (5.0, -7.0))) <= 4 * 0.15  # every third cell is a place
    assert np.abs(way[:, 1] + 7.0).max() <= 2 * 0.15


def test_a_kept_field_stays_when_the_next_one_is_found():
    travel = Travel(CONFIG, stage(), 8.0, 0.08)
    found = travel.field(NOTHING, np.array([5.0, -7.0]), HERE)
    kept, before = found.kept(), cost_to_go(found, HERE[None])
    travel.field(NOTHING, np.array([3.0, -1.0]), HERE)
    assert cost_to_go(kept, HERE[None]) == before
    assert cost_to_go(found, HERE[None]) != before  # the arrays are used again


def closed_room(half):
    """Points of a room of 4 m about `HERE` whose only exit, to the right, leaves `half` [m] on each side."""
    along = np.arange(-2.0, 2.0, 0.05)
    sides = [np.column_stack((along, np.full(80, y))) for y in (-2.0, 2.0)]
    sides.append(np.column_stack((np.full(80, -2.0), along)))
    door = np.concatenate((np.arange(half, 2.0, 0.05), -np.arange(half, 2.0, 0.05)))
    return HERE + np.concatenate((*sides, np.column_stack((np.full(len(door), 2.0), door))))


@pytest.mark.parametrize("narrow", [True, False])
def test_a_passage_that_leaves_less_than_the_margin_is_narrow_or_closed(narrow):
    points = closed_room(stage().footprint.inscribed_radius + 0.04)
    found = Travel(CONFIG, stage(), 8.0, 0.08, narrow).field(points, BEYOND_DOOR, HERE)
    assert math.isfinite(found.robot_time) == narrow
    places, ahead = found.descent(Pose(*HERE, 0.0), 5.0)
    assert ahead == (pytest.approx(2.0, abs=0.3) if narrow else math.inf)
    assert (len(places) > 0 and places[:, 0].max() > 2.5) == narrow


def test_a_narrow_passage_takes_as_long_as_is_asked_for():
    points, travel = (
        closed_room(stage().footprint.inscribed_radius + 0.04),
        Travel(CONFIG, stage(), 8.0, 0.08),
    )
    times = [travel.field(points, BEYOND_DOOR, HERE, narrow=narrow).robot_time for narrow in (100.0, 200.0)]
    assert times[1] - times[0] == pytest.approx(times[0], rel=0.3)  # nearly all of it is that of the passage


def test_a_way_round_outside_the_grid_is_better_than_a_narrow_passage():
    half = stage().footprint.inscribed_radius + 0.04
    beside = np.concatenate((np.arange(half, 7.0, 0.05), -np.arange(half, 30.0, 0.05)))
    wall = HERE + np.column_stack((np.full(len(beside), 1.0), beside))
    found = field(wall)
    _, ahead = found.descent(Pose(*HERE, 0.0), 5.0)
    assert ahead == math.inf
    assert 14.0 / stage().v_max < found.robot_time < 20.0 / stage().v_max


def test_the_way_through_a_place_where_the_robot_was_stuck_takes_longer_and_at_last_leads_round_it():
    beside = np.concatenate(
        (np.arange(-8.0, -0.75, 0.05), np.arange(0.75, 3.0, 0.05), np.arange(5.0, 8.0, 0.05))
    )
    wall = HERE + np.column_stack(
        (np.full(len(beside), 2.0), beside)
    )  # two doors, of which one is straight ahead
    door = HERE + np.array([2.0, 0.0])
    ways, times = [], []
    for cost in (0.0, 3.0, 300.0):
        stuck = np.array([[*door, 0.0, 0.0, 0.9, cost]])
        found = Travel(CONFIG, stage(), 8.0, 0.08).field(wall, BEYOND_DOOR, HERE, stuck=stuck)
        ways.append(found.descent(Pose(*HERE, 0.0), 12.0)[0])
        times.append(found.robot_time)
    assert times[0] + 3.0 < times[1] < times[2] < times[0] + 60.0
    assert np.abs(ways[0][:, 1]).max() < 0.75 < 3.0 < ways[2][:, 1].max()
