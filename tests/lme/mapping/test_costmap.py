import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.grids.obstacle_grid import HIGHEST, INSCRIBED, TOUCHING, draw_polygon
from lme.guides.global_path.kernels import search
from lme.mapping.costmap import Costmap, stamp
from lme.mapping.map_clock import MapInput
from lme.simulation.fast import FastSimulator
from lme.types import Pose, Twist
from lme.worlds.world import World
from tests.builders import CLUTTER, observation, stage, task

SEEDS = st.integers(0, 2**32 - 1)
HERE = Pose(0.0, 0.0, 0.0)


def costmap(robot=None, goal=(4.0, 0.0), **settings):
    return Costmap(
        load_settings("guide/global_path", costmap=settings).costmap, robot or stage(), np.array([goal])
    )


def taken(observed, pose=None):
    """What a map takes in at a pose, of the observation's if not given."""
    return MapInput(observed.scan, observed.odometry, pose or observed.odometry)


def occupied(grid):
    """(K, 2) [m] centres of the cells where a robot touches something, for a robot of no size."""
    return grid.points(np.argwhere(grid.costs == TOUCHING))


def bare(**changes):
    """Costs of exactly the occupied cells: a robot too small to be inflated."""
    settings = {"footprint_padding": 0.0, "inflation_radius": 0.0}
    robot = stage()
    robot.footprint.radius = 0.001
    return costmap(robot, **{**settings, **changes})


# Inflation


@given(SEEDS)
def test_costs_are_those_of_the_distance_to_the_nearest_obstacle(seed):
    rng = np.random.default_rng(seed)
    world = World(circles=np.column_stack([rng.uniform(-3, 6, (5, 2)), rng.uniform(0.01, 0.4, 5)]))
    inflation = rng.uniform(0.3, 1.0)
    grid, source = costmap(inflation_radius=inflation, cost_scaling_factor=4.0), bare()
    for drawn in (grid, source):
        drawn.draw(world, HERE)
        drawn.refresh()
    away = 0.05 * distance_transform_edt(source.costs == 0)
    fading = np.floor(HIGHEST * np.exp(-4.0 * np.maximum(away - 1e-9 - 0.3, 0)))
    reached = [away <= reach + 1e-9 for reach in (0.2, 0.3, inflation)]
    np.testing.assert_array_equal(grid.costs, np.select(reached, [TOUCHING, INSCRIBED, fading], 0))


def test_costs_of_new_hits_stand_at_once():
    grid = costmap()
    ranges = np.full(540, 15.0, np.float32)
    ranges[250:290] = 1.5
    grid.observe(taken(observation(ranges=ranges)))
    at_once = grid.costs.copy()
    grid.refresh()
    assert (at_once > 0).any()
    np.testing.assert_array_equal(at_once, grid.costs)


def test_costs_of_what_was_freed_go_with_the_next_refresh():
    grid = costmap(observation_persistence=0.0)
    ranges = np.full(540, 15.0, np.float32)
    ranges[250:290] = 1.5
    grid.observe(taken(observation(ranges=ranges)))
    grid.observe(taken(observation()))
    assert (grid.costs > 0).any()
    grid.refresh()
    assert not grid.costs.any()


def test_kul_fms_map_clears_nothing_but_what_the_robot_covers():
    settings, robot = load_settings("guide/navfn_kul_fm").costmap, stage()
    grid = Costmap(settings, robot, np.array([[5.0, 0.0]]))
    ranges = np.full(540, 15.0, np.float32)
    ranges[250:290] = 4.0
    grid.observe(taken(observation(ranges=ranges)))
    marked = grid.costs.copy()
    behind = np.full(540, 14.0, np.float32)  # beams that pass all marks, and mark nothing
    for _ in range(50):
        grid.observe(taken(observation(ranges=behind)))
    grid.refresh()
    np.testing.assert_array_equal(grid.costs, marked)
    mark = grid.points(np.argwhere(grid.costs == TOUCHING))[0]
    grid.observe(taken(observation(ranges=behind), Pose(*mark, 0.0)))
    grid.refresh()
    assert (grid.costs == TOUCHING).sum() < (marked == TOUCHING).sum()


@given(SEEDS, st.booleans())
def test_refreshed_costs_are_those_of_all_obstacles_anew(seed, footprint_clearing):
    """A new stamp, even an equal one, has the costs recomputed; without it that may be left out."""
    rng = np.random.default_rng(seed)
    settings = {"observation_persistence": 0.2 * rng.integers(3), "footprint_clearing": footprint_clearing}
    grid, anew = costmap(**settings), costmap(**settings)
    for _ in range(8):
        ranges = rng.uniform(0.2, 4.0, 540).astype(np.float32)
        pose = Pose(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0))
        for either in (grid, anew):
            either.observe(taken(observation(ranges=ranges), pose))
        if rng.random() < 0.7:
            anew.stamp = anew.stamp.copy()
            for either in (grid, anew):
                either.refresh()
            np.testing.assert_array_equal(grid.costs, anew.costs)


def test_an_obstacle_costs_at_least_the_inscribed_radius_whatever_the_inflation():
    rows = stamp(
        load_settings(
            "guide/global_path", costmap={"inflation_radius": 0.0, "footprint_padding": 0.1}
        ).costmap,
        0.2,
    )
    reach = np.hypot(rows[:, 0], rows[:, 1]).max() * 0.05
    assert reach == pytest.approx(0.3)
    assert (rows[:, 2] >= INSCRIBED).all()


# Drawing the true map


def test_a_disc_occupies_the_cells_it_touches():
    grid = bare()
    grid.draw(World(circles=np.array([[1.01, 0.52, 0.13]])), HERE)
    grid.refresh()
    centres = grid.points(np.argwhere(np.ones_like(grid.costs)))
    corner = np.maximum(np.abs(centres - [1.01, 0.52]) - 0.025, 0)
    wanted = centres[np.hypot(*corner.T) <= 0.13]
    np.testing.assert_array_equal(occupied(grid), wanted)


def test_a_disc_smaller_than_a_cell_occupies_one():
    grid = bare()
    grid.draw(World(circles=np.array([[1.0, 0.5, 0.001]])), HERE)
    grid.refresh()
    assert occupied(grid) == pytest.approx(np.array([[1.0, 0.5]]))


@given(SEEDS, st.booleans())
def test_a_polygon_occupies_the_cells_whose_centres_lie_in_it(seed, on_centres):
    rng = np.random.default_rng(seed)
    polygon = rng.uniform(-3.0, 5.0, (rng.integers(3, 9), 2))  # it may cross itself, and leave the grid
    polygon = 0.05 * np.round(polygon / 0.05) if on_centres else polygon
    hits, grid = np.zeros((90, 70), np.int32), (-30, -20, 0.05)
    draw_polygon(hits, grid, polygon)
    x, y = ((np.arange(count) + low) * 0.05 for count, low in zip(hits.shape, grid[:2], strict=True))
    inside = np.zeros(hits.shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crossed = (y < y0) != (y < y1)
        where = x0 + (x1 - x0) * (y - y0) / np.where(crossed, y1 - y0, 1.0)
        inside ^= crossed & (x[:, None] < where)
    np.testing.assert_array_equal(hits != 0, inside)


@given(st.floats(0.1, math.pi - 0.1), st.floats(-1, 1))
def test_a_wall_lets_nothing_through(bearing, offset):
    away = 30.0 * np.array([math.cos(bearing), math.sin(bearing)])
    grid = bare(margin=2.0)
    grid.draw(
        World(segments=np.array([[1.0 + offset - away[0], -away[1], 1.0 + offset + away[0], away[1]]])), HERE
    )
    grid.refresh()
    table = np.where(np.arange(256) < INSCRIBED, 1.0, np.inf)
    ends = [grid.cell(np.array(point)) for point in ((-0.1, 0.0), (2.1, 0.0))]
    assert np.isinf(search(grid.costs, table, *ends, 1.0)[ends[1]])
    assert occupied(grid) @ [-away[1], away[0]] == pytest.approx(
        -30 * (1 + offset) * math.sin(bearing), abs=30 * 0.036
    )


def test_a_polygon_is_solid():
    grid = bare()
    grid.draw(World(polygons=(np.array([[1.0, -1.0], [2.0, -1.0], [1.5, 1.0]]),)), HERE)
    grid.refresh()
    inside, outside = np.array([[1.5, -0.5], [1.5, 0.5]]), np.array([[1.1, 0.5], [1.9, 0.5], [1.5, 1.2]])
    assert grid.forbidden(inside).all()
    assert not grid.forbidden(outside).any()


def test_scans_mark_what_the_true_map_holds():
    robot, start = stage(), Pose(-1.0, 0.5, 0.7)
    robot.footprint.radius = 0.001
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    seen = [simulator.reset(task(CLUTTER, start=start), np.random.default_rng(0))]
    seen += [simulator.step(Twist(0.3, 0.5)) for _ in range(8)]
    maps = [bare(), bare()]
    for observed in seen:
        maps[0].observe(taken(observed))
    maps[1].draw(CLUTTER, start)
    for grid in maps:
        grid.refresh()
    scanned, drawn = map(occupied, maps)
    assert len(scanned) > 20
    gaps = np.linalg.norm(scanned[:, None] - drawn[None], axis=2).min(axis=1)
    assert gaps.max() <= 0.0501


def test_a_map_is_cleared_where_the_robot_was_when_it_was_rebuilt():
    robot = stage()  # a disc; the post is 0.5 m ahead of where the scan was taken
    robot.footprint.radius = 0.2
    seen = FastSimulator(load_settings("sim/fast"), robot).reset(
        task(World(circles=np.array([[0.5, 0.0, 0.05]])), goal=(5.0, 0.0)), np.random.default_rng(0)
    )
    clearing = {"footprint_clearing": True, "footprint_padding": 0.1, "observation_persistence": 0.0}
    for x, left in ((0.0, True), (0.1, True), (0.5, False)):  # the padded disc reaches to x + 0.3
        grid = costmap(robot, **clearing)
        grid.observe(taken(seen, Pose(x, 0.0, 0.0)))
        grid.refresh()
        assert (len(np.argwhere(grid.costs == TOUCHING)) > 0) == left


# The grid


@given(SEEDS, st.floats(-6, 6), st.floats(-6, 6))
def test_a_mirrored_scene_gives_the_mirrored_grid(seed, x, y):
    rng = np.random.default_rng(seed)
    robot = stage(fov=math.radians(270), num_beams=271)
    ranges = rng.uniform(0.1, 3, 271).astype(np.float32)
    pose = Pose(*rng.uniform(-2, 2, 3))
    grids = []
    for side in (1, -1):
        grid = costmap(robot, goal=(x, side * y))
        mirrored = Pose(pose.x, side * pose.y, side * pose.yaw)
        grid.observe(taken(observation(ranges=ranges[::side], robot=robot, odometry=mirrored)))
        grids.append(grid)
    np.testing.assert_array_equal(grids[0].costs, grids[1].costs[:, ::-1])
    points = rng.uniform(-3, 3, (20, 2))
    np.testing.assert_array_equal(grids[0].forbidden(points), grids[1].forbidden(points * [1, -1]))


@pytest.mark.parametrize("goal", [(10.0, 0.0), (-3.0, 7.0), (0.0, 0.0), (0.02, -0.03)])
def test_the_grid_holds_start_goal_and_margin(goal):
    grid = costmap(goal=goal, margin=2.0)
    corners = grid.points(np.array([(0, 0), np.array(grid.costs.shape) - 1]))
    assert (corners[0] <= np.minimum(goal, 0) - 2.0).all()
    assert (corners[1] >= np.maximum(goal, 0) + 2.0).all()
    assert (corners[1] - corners[0] <= np.abs(goal) + 4.0 + 4 * 0.05).all()


def test_a_point_lies_in_the_cell_with_the_nearest_centre():
    grid = costmap()
    for point in np.random.default_rng(0).uniform(-3, 3, (50, 2)):
        centre = grid.points(np.array([grid.cell(point)]))[0]
        assert np.abs(centre - point).max() <= 0.0251


def test_a_point_outside_counts_as_the_nearest_cell_on_the_grid():
    grid = costmap()
    assert grid.cell(np.array([-99.0, 99.0])) == (0, grid.costs.shape[1] - 1)
    assert not grid.forbidden(np.array([[-99.0, 99.0]])).any()


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"cell_size": 0.0}, "guide.costmap.cell_size"),
        ({"obstacle_range": -1.0}, "guide.costmap.obstacle_range"),
        ({"raytrace_range": math.inf}, "guide.costmap.raytrace_range"),
        ({"footprint_padding": -0.1}, "guide.costmap.footprint_padding"),
        ({"observation_persistence": math.nan}, "guide.costmap.observation_persistence"),
        ({"update_rate": 0.0}, "guide.costmap.update_rate is 0: must be greater than 0"),
        ({"cell_size": 0.001}, "costmap.cell_size is 0.001"),
        ({"inflation_radius": 10.1}, "costmap.inflation_radius is 10.1: .* at most 200 cells, 10 m"),
        ({"footprint_padding": 10.1}, "costmap.footprint_padding is 10.1"),
    ],
)
def test_mistakes_name_their_key(settings, key):
    with pytest.raises(InputError, match=key):
        costmap(**settings)
