"""Expected times: against shortest ways over many neighbours, exact ways round a corner, and turned scenes."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lme.geometry.frames import to_world
from lme.guides.lme_plus.travel_grid import Grid, SpeedProfile, descend, times_at, turns_at, workspace
from lme.guides.lme_plus.travel_time import BUCKETS, travel_times
from lme.types import Pose
from tests import oracles
from tests.tolerances import ARRIVAL_CELLS, ARRIVAL_SHARE, KERNEL

CELL, SIZE = 0.1, 50
GRID = Grid(-2.5, -2.5, CELL, SIZE)
CELLS = (*GRID,)  # as the kernels are given it
PACE = SpeedProfile(v_max=2.0, tight=0.25, inner=0.25, comfort=0.5, slowdown=2.0, narrow=100.0, room=0.3)
CELL_TIME = CELL / PACE.v_max
NOTHING, NOBODY, UNKNOWN = np.empty((0, 2)), np.empty((0, 6)), np.zeros((SIZE + 2, SIZE + 2))
NOWHERE = np.zeros((SIZE + 2) ** 2, np.bool_)  # is narrow
ALL = 1e3  # [s] beyond the best: every way is searched
SEEDS = st.integers(0, 10**6)


def search(points, target, robot=(0.0, 0.0), grid=GRID, pace=PACE, beyond=ALL, leave=False, learned=UNKNOWN):
    """The times, which cells are narrow, and the robot's time."""
    given = (np.array(each, dtype=float).reshape(-1, 2) for each in (points, target, robot))
    points, target, robot = given
    work = workspace(grid.size, grid.cell, pace.comfort)
    time = travel_times(
        (*work,), points, target[0], robot[0], (*grid,), (*pace,), NOBODY, learned, (0, 0), beyond, leave
    )
    return work.times, work.narrow, time


def times(*scene, **settings):
    """The times, and the robot's."""
    field, _, time = search(*scene, **settings)
    return field, time


def inside(field):
    """Without the frame."""
    return field[1:-1, 1:-1]


def centres(grid=GRID):
    along = (np.arange(grid.size) + 0.5) * grid.cell
    return np.stack(np.meshgrid(grid.x + along, grid.y + along, indexing="ij"), axis=-1)


def near(time):
    """How much two ways to compute a time may differ."""
    return ARRIVAL_SHARE * time + ARRIVAL_CELLS * CELL_TIME


def scene(seed, count=6):
    """Points away from the edge and the target, one per cell, a target and a robot."""
    rng = np.random.default_rng(seed)
    robot, target = rng.uniform(-1.6, 1.6, 2), rng.uniform(-1.6, 1.6, 2) * rng.choice([1.0, 3.0])
    points = rng.uniform(-1.8, 1.8, (rng.integers(0, count + 1), 2))
    points = points[np.unique(np.floor(points / CELL), axis=0, return_index=True)[1]]
    return points[np.hypot(*(points - target).T) > 0.6], target, robot


@given(SEEDS, st.booleans())
def test_times_are_those_of_shortest_ways(seed, leave):
    points, target, robot = scene(seed)
    field, _ = times(points, target, robot, leave=leave)
    slow = oracles.travel_times(points, target, robot, GRID, PACE, leave)
    found = np.isfinite(slow)
    np.testing.assert_array_equal(np.isfinite(inside(field)), found)
    assert (np.abs(inside(field)[found] - slow[found]) <= near(slow[found])).all()


@given(SEEDS, st.booleans(), st.sampled_from([0.0, 0.5, ALL]), st.sampled_from([0.2, 0.25]))
def test_times_are_exactly_those_of_the_plain_march_and_a_workspace_forgets(seed, leave, beyond, tight):
    grid, pace = Grid(-1.5, -1.5, CELL, 30), PACE._replace(room=0.4, tight=tight)
    work = workspace(grid.size, grid.cell, pace.comfort)
    rng = np.random.default_rng(seed)
    for _ in range(2):  # the second time in the arrays of the first
        robot, target = rng.uniform(-0.9, 0.9, 2), rng.uniform(-0.9, 0.9, 2) * rng.choice([1.0, 3.0])
        beside = target + rng.uniform(-0.4, 0.4, (rng.integers(2), 2))
        points = np.concatenate(
            (robot + rng.uniform(-0.4, 0.4, (1, 2)), rng.uniform(-1.6, 1.6, (9, 2)), beside)
        )
        points = points[np.sort(np.unique(np.floor(points / CELL), axis=0, return_index=True)[1])]
        people = people_of(rng, rng.integers(3))
        known = rng.uniform(0.0, 9.0, (50, 60)) * (rng.random((50, 60)) < 0.5)
        scene_ = points, target, robot, (*grid,), (*pace,), people, known, (7, 11)
        best = travel_times((*work,), *scene_, beyond, leave)
        steps = steps_across(points, robot, target, grid, pace) + waits(people, robot, grid, pace)
        at, here = ((place + 1.5) / CELL + 0.5 for place in (target, robot))
        enclosed = not leave and oracles.within_disc(at, grid.size)
        stops = beyond, enclosed, BUCKETS, 0.1
        learned = known[8 : 8 + grid.size, 12 : 12 + grid.size]
        field, slow = oracles.march(steps, at, here, grid.size, CELL / pace.v_max, *stops, learned)
        np.testing.assert_allclose(work.times, field, rtol=0.0, atol=KERNEL)
        assert best == slow == math.inf or abs(best - slow) <= KERNEL


def people_of(rng, count):
    """(P, 6) places, velocities, radii, and the time per metre that it costs to be where they are."""
    return rng.uniform((-1.5, -1.5, -1.0, -1.0, 0.2, 0.1), (1.5, 1.5, 1.0, 1.0, 0.8, 4.0), (count, 6))


def steps_across(points, robot, target, grid, pace):
    """Time across each cell [s]; inf: no passage."""
    d = np.hypot(*(centres(grid)[..., None] - points.T).transpose(2, 0, 1, 3)).min(axis=-1)
    least = min(np.hypot(*(points - robot).T).min(), pace.inner) - math.sqrt(0.5) * grid.cell
    far = np.hypot(*(centres(grid) - robot).transpose(2, 0, 1)) > pace.room
    share = (pace.comfort - np.clip(d, pace.inner, pace.comfort)) / (pace.comfort - pace.inner)
    half = oracles.passages(points, grid, pace) if pace.tight < pace.inner else np.zeros_like(d)
    wide = np.maximum(d, half)
    tightness = (pace.inner - np.clip(wide, pace.tight, pace.inner)) / max(pace.inner - pace.tight, 1e-9)
    beside = (wide >= least) & ~far
    tightness[beside & (half > 0.0)] = 0.0
    paces = 1.0 + pace.slowdown * share**2 + (pace.narrow - 1.0 - pace.slowdown) * tightness
    closed = (wide < pace.tight) & ~beside
    steps = np.where(closed, np.inf, grid.cell * paces / pace.v_max)
    at = (target - (grid.x, grid.y)) / grid.cell
    i, j = np.floor(at).astype(int)
    if oracles.within_disc(at + 0.5, grid.size) and d[i, j] < pace.inner:
        near = np.hypot(*(centres(grid) - target).transpose(2, 0, 1)) < 2.0 * pace.inner
        beside = (steps > 20.0 * grid.cell / pace.v_max) & near & (d > math.sqrt(0.5) * grid.cell)
        steps = np.where(beside, 20.0 * grid.cell / pace.v_max, steps)
    return steps


def waits(people, robot, grid, pace):
    """Time across each cell that people cost, where they are when the robot is there [s]."""
    after = np.hypot(*(centres(grid) - robot).transpose(2, 0, 1)) / pace.v_max
    costs = np.zeros(after.shape)
    for x, y, vx, vy, radius, cost in people:
        there = np.stack((x + after * vx, y + after * vy), axis=-1)
        met = np.hypot(*(there - centres(grid)).transpose(2, 0, 1)) < radius
        costs = np.where(met, np.maximum(costs, cost), costs)
    return grid.cell * costs


@given(SEEDS, st.sampled_from([0.0, 0.3, 1.0]))
def test_cells_that_are_not_searched_are_on_no_good_way(seed, beyond):
    points, target, robot = scene(seed)
    (whole, best), (part, robot_time) = (times(points, target, robot, beyond=b) for b in (ALL, beyond))
    if math.isinf(best):
        assert math.isinf(robot_time)
        return
    assert abs(robot_time - best) <= near(best)
    straight = np.hypot(*(centres() - robot).transpose(2, 0, 1)) / PACE.v_max
    skipped = np.isfinite(inside(whole)) & ~np.isfinite(inside(part))
    assert (inside(whole)[skipped] + straight[skipped] >= best + beyond - near(best)).all()


def test_a_robot_too_near_to_a_point_has_a_way_out_but_no_other_place_does():
    point = [(0.1, 0.1)]
    assert math.isfinite(times(point, (2.0, 0.0))[1])
    assert math.isinf(times(point, (2.0, 0.0), pace=PACE._replace(room=0.0))[1])
    field, _ = times(point, (2.0, 0.0), robot=(-1.0, 0.0))
    assert math.isinf(inside(field)[26, 26])


@pytest.mark.parametrize("tight", [0.24, 0.2, 0.26])
def test_a_passage_narrower_than_the_margin_takes_longer_the_narrower_it_is(tight):
    along = np.linspace(-1.0, 1.0, 120)
    walls = np.concatenate([np.column_stack((along, np.full(120, y))) for y in (-0.3, 0.2)])
    beside = np.column_stack((np.zeros(500), np.linspace(-25.0, 25.0, 500)))
    beside = beside[np.abs(beside[:, 1] + 0.05) > 0.25]
    pace, passes = PACE._replace(tight=tight, inner=0.3, comfort=0.5), tight < 0.25
    field, narrow, through = search(np.concatenate((walls, beside)), (2.05, -0.05), (-2.05, -0.05), pace=pace)
    length = 2.0 + 2.0 * math.sqrt(0.3**2 - 0.25**2)  # [m] with less than `inner` on both sides
    exact = (4.1 + (2.0 + 97.0 * (0.3 - 0.25) / (0.3 - tight)) * length) / PACE.v_max
    assert through == (pytest.approx(exact, rel=0.12) if passes else math.inf)
    places, ahead = descend(field, narrow, (-2.05, -0.05, 0.0), CELLS, 5.0, 3)
    assert ahead == (pytest.approx(2.05 - length / 2, abs=1.5 * CELL) if passes else math.inf)
    assert len(places) == (13 if passes else 0)


def test_a_passage_that_leaves_a_little_less_takes_a_little_longer():
    walls = [(0.0, sign * (0.301 + away)) for sign in (-1.0, 1.0) for away in np.arange(0.0, 30.0, 0.02)]
    given = np.array(walls), (1.5, 0.0), (-1.5, 0.0)
    paces = [PACE._replace(tight=0.2, inner=inner, comfort=0.6) for inner in (0.307, 0.309, 0.311)]
    through = [search(*given, pace=pace)[2] for pace in paces]
    assert (np.diff(through) > 0.0).all()
    assert (np.diff(through) < 0.4).all()  # [s]


def test_in_a_narrow_passage_the_way_is_narrow_from_the_start_but_not_slow():
    """So a robot in a door keeps what the door leaves, and the last resort counts only before it."""
    walls = np.array([(0.0, sign * away) for sign in (-1.0, 1.0) for away in np.arange(0.24, 30.0, 0.02)])
    pace = PACE._replace(tight=0.2, inner=0.28)
    before, inside = (search(walls, (1.5, 0.0), (x, 0.0), pace=pace) for x in (-1.5, 0.0))
    assert before[2] > 5.0 > 1.5 > inside[2]
    field, narrow, _ = inside
    assert descend(field, narrow, (0.0, 0.0, 0.0), CELLS, 5.0, 3)[1] == 0.0


@given(st.floats(0.0, 1.5), st.floats(0.215, 0.25), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_door_is_open_however_the_cells_lie(angle, half, x, y):
    """A straight wall with a door that leaves 2.5 cm on each side: from everywhere the robot has a way through it.

    With less than 2 cm it has none at some places of the grid, 19 of 4,000 random ones.
    """
    away = np.arange(half, 30.0, 0.02)
    wall = np.column_stack((np.zeros(2 * len(away)), np.concatenate((away, -away))))
    pace, places = PACE._replace(tight=0.19, inner=0.26, comfort=0.6), np.array([[1.5, 0.0], [-1.5, 0.0]])
    turned, (target, robot) = (to_world(each, Pose(x, y, angle)) for each in (wall, places))
    _, narrow, time = search(turned, target, robot, pace=pace)
    assert 3.0 / PACE.v_max < time < math.inf
    assert narrow.any()


def test_beside_one_wall_nothing_is_narrow():
    wall = np.column_stack((np.linspace(-1.0, 1.0, 100), np.full(100, 0.2)))  # nearer than `inner`
    field, narrow, _ = search(wall, (2.0, 0.0), pace=PACE._replace(tight=0.15))
    assert not narrow.any()
    assert descend(field, narrow, (0.0, 0.0, 0.0), CELLS, 5.0, 3)[1] == math.inf


@given(SEEDS)
def test_times_between_cells_are_interpolated(seed):
    rng = np.random.default_rng(seed)
    slope, places = rng.uniform(-1, 1, 2), rng.uniform(-2.4, 2.4, (20, 2))
    field = np.pad(9.0 + centres() @ slope, 1, constant_values=np.inf)
    assert times_at(field, places, CELLS) == pytest.approx(9.0 + places @ slope, abs=KERNEL)


def test_times_are_of_the_cells_that_have_one():
    field = np.full((SIZE + 2, SIZE + 2), np.inf)
    field[11, 11] = 3.0  # its centre is at −2.5 + 10.5 cells
    at = -2.5 + 10.5 * CELL
    places = np.array([[at, at], [at + 0.09, at - 0.09], [at + 0.11, at], [9.0, 9.0]])
    assert times_at(field, places, CELLS).tolist() == [3.0, 3.0, math.inf, math.inf]


def cells_of(places):
    """Row and column of places, from 0."""
    return np.floor((np.asarray(places) + 2.5) / CELL).astype(int)


def fall(field, cell, axis):
    """By how much T falls along an axis about a cell (row, column), from 0."""
    step = 4 * np.eye(2, dtype=int)[axis]
    before, here, after = (inside(field)[tuple(at)] for at in (cell - step, cell, cell + step))
    if math.isinf(before):
        return 0.0 if math.isinf(after) else 2.0 * (here - after)
    return 2.0 * (before - here) if math.isinf(after) else before - after


@given(SEEDS)
@example(249103)  # a place that the search reached alone, behind the robot
def test_turns_at_places_are_those_to_the_steepest_descent(seed):
    points, target, robot = scene(seed)
    field, _ = times(points, target, robot, beyond=1.0)
    pose, places = Pose(*robot, 0.7), np.random.default_rng(seed).uniform(-1.5, 1.5, (20, 2))
    found = turns_at(field, places, (*pose,), CELLS, target)
    for place, turn in zip(to_world(places, pose), found, strict=True):
        cell, way = cells_of(place), place - robot
        searched = (cell >= 4).all() and (cell < SIZE - 4).all() and math.isfinite(inside(field)[tuple(cell)])
        if not searched or math.dist(place, target) < 4.0 * CELL:
            assert turn == 0.0
            continue
        down = fall(field, cell, 0), fall(field, cell, 1)
        expected = abs(np.angle(complex(*down) / complex(*way))) if any(down) else 0.0
        assert turn == pytest.approx(expected, abs=1e-9)


def test_in_the_open_the_turn_at_a_place_is_that_to_the_target():
    field, _ = times(NOTHING, (-1.5, 0.0), (1.0, 0.0))
    near_an_end = [[-2.3, 0.0], [1.4, 0.0]]
    places = np.array([[0.8, 0.0], [0.0, 1.0], [-1.0, 0.0], *near_an_end])
    found = turns_at(field, places, (1.0, 0.0, 0.0), CELLS, np.array([-1.5, 0.0]))
    assert found == pytest.approx([math.pi, math.pi / 2 + math.atan(1 / 2.5), 0.0, 0.0, 0.0], abs=0.1)


def test_along_a_wall_there_is_no_turn():
    wall = np.column_stack((np.linspace(-2.4, 2.4, 200), np.full(200, 0.45)))
    field, _ = times(wall, (2.2, 0.0), (-2.0, 0.0), beyond=1.0)
    places = np.column_stack((np.arange(0.8, 3.0, 0.2), np.zeros(11)))
    assert (turns_at(field, places, (-2.0, 0.0, 0.0), CELLS, np.array([2.2, 0.0])) < 0.3).all()


@given(SEEDS)
def test_the_way_down_falls_at_every_place_and_ends_at_the_target(seed):
    points, target, robot = scene(seed)
    target = np.clip(target, -1.5, 1.5)
    field, robot_time = times(points, target, robot)
    pose = Pose(*robot, 0.7)
    found, _ = descend(field, NOWHERE, (*pose,), CELLS, 50.0, 1)
    way = to_world(found, pose)
    if math.isinf(robot_time):
        return
    levels = [field[tuple(cells_of(place) + 1)] for place in (robot, *way)]
    assert (np.diff(levels) < 0.0).all()
    assert np.hypot(*(way[-1] - target if len(way) else robot - target)) <= 1.5 * CELL
    np.testing.assert_array_equal(descend(field, NOWHERE, (*pose,), CELLS, 50.0, 3)[0], found[2::3])
    short, _ = descend(field, NOWHERE, (*pose,), CELLS, 0.75, 1)
    np.testing.assert_array_equal(short, found[:7])


def test_descending_from_an_infinite_time_gives_no_way():
    field = np.full((SIZE + 2, SIZE + 2), np.inf)
    places, ahead = descend(field, NOWHERE, (0.0, 0.0, 0.0), CELLS, 5.0, 3)
    assert places.shape == (0, 2)
    assert ahead == math.inf


def test_people_are_time_and_not_walls():
    """A person in a gap costs time; one who is gone when the robot gets there costs nothing."""
    wall = np.array([[1.0, y] for y in np.arange(-2.4, 2.5, 0.05) if abs(y) > 0.5])
    given = (
        (*workspace(SIZE, CELL, PACE.comfort),),
        wall,
        np.array([2.0, 0.0]),
        np.zeros(2),
        (*GRID,),
        (*PACE,),
    )
    free = travel_times(*given, NOBODY, UNKNOWN, (0, 0), ALL, False)
    standing = travel_times(*given, np.array([[1.0, 0.0, 0.0, 0.0, 0.5, 3.0]]), UNKNOWN, (0, 0), ALL, False)
    leaving = travel_times(*given, np.array([[1.0, 0.0, 0.0, 2.0, 0.5, 3.0]]), UNKNOWN, (0, 0), ALL, False)
    assert standing == pytest.approx(free + 3.0, rel=0.1)  # 1 m at 3 s/m
    assert leaving == pytest.approx(free, abs=0.02)


def test_a_target_beside_a_wall_is_approached_from_its_own_side():
    """Nearer than passage allows: the least time is in the middle of the passage before it, not behind the wall."""
    wall = np.array([[1.0, y] for y in np.arange(-2.4, 2.5, 0.05)])
    field, time = times(wall, (0.88, 0.0), robot=(-1.0, 0.5))
    assert math.isfinite(time)
    passage = np.where(centres()[..., 0] < 1.0 - PACE.inner, inside(field), np.inf)
    i, j = np.unravel_index(passage.argmin(), passage.shape)
    assert centres()[i, j] == pytest.approx([1.0 - PACE.inner, 0.0], abs=1.5 * CELL)
    assert not np.isfinite(inside(field)[centres()[..., 0] > 1.1]).any()


def test_the_way_beyond_the_edge_takes_as_long_as_was_learned_of_the_cell_there():
    target, ahead, little, inner = (30.0, 0.0), *np.zeros((3, SIZE + 2, SIZE + 2))
    ahead[SIZE // 2 :, 11:41], little[SIZE // 2 :], inner[11:41, 11:41] = 99.0, 9.0, 99.0
    free, around = times(NOTHING, target)[1], times(NOTHING, target, learned=ahead)[1]
    assert free == pytest.approx(15.0, abs=near(2.0))
    assert free + 0.1 < around < 17.0  # past the places on which it takes 99 s
    assert times(NOTHING, target, learned=little)[1] == free  # less than the straight way
    assert times(NOTHING, target, learned=inner)[1] == free  # not at the edge
    assert times(NOTHING, (1.0, 0.0), learned=ahead)[1] == times(NOTHING, (1.0, 0.0))[1]
