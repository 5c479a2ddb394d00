"""Learned subgoals: what the network sees, by hand and mirrored; what its choice means; its file; the guide."""

import math
import warnings

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.guides.learned_subgoal import LearnedSubgoal
from lme.guides.learned_subgoal.guide import REACH, SubgoalInterface, nearest_by_sector
from lme.guides.learned_subgoal.network import (
    BEARINGS,
    CANDIDATES,
    LAYERS,
    RANGES,
    SHAPES,
    SIGNATURE,
    SLOPE,
    candidates,
    draw,
    mirrored_bearings,
    write_weights,
)
from lme.inputs.onnx_file import TRAINED
from lme.inputs.onnx_graph import read_weights
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Twist
from lme.worlds.world import World
from tests.builders import CLUTTER, observation, room, stage, task
from tests.networks import network_file, random_subgoal, refused, signed, subgoal_file
from tests.oracles import nearest_by_sector_slow
from tests.tolerances import FLOAT32_LAYER, KERNEL, MIRROR

ROBOT = stage(fov=1.5 * math.pi, num_beams=700)
WALL = World(segments=np.array([[1.0, -3.0, 1.0, 3.0]]))  # across, 1 m ahead


def sight(world, robot=ROBOT, target=(4.0, 0.0), twist=None):
    """What a robot in a world sees."""
    seen = FastSimulator(load_settings("sim/fast"), robot).reset(
        task(world, goal=target), np.random.default_rng(0)
    )
    return seen if twist is None else seen._replace(twist=twist)


def features(world, robot=ROBOT, **settings):
    seen = sight(world, robot)
    return SubgoalInterface(load_settings("guide/learned_subgoal", **settings), robot).features(
        seen, seen.target
    )


def test_the_grid_by_hand():
    grid = candidates().reshape(BEARINGS, len(RANGES), 2)
    assert grid[0, :, 0] == pytest.approx(RANGES)
    assert grid[BEARINGS // 4, 1] == pytest.approx([0.0, RANGES[1]])
    assert grid[mirrored_bearings()] == pytest.approx(grid * [1.0, -1.0])


def test_the_nearest_point_of_each_sector_is_that_of_the_slow_twin():
    rng = np.random.default_rng(0)
    for count in (0, 1, 500):
        points = rng.normal(scale=4.0, size=(count, 2))
        found = nearest_by_sector(points, BEARINGS, REACH)
        assert found == pytest.approx(nearest_by_sector_slow(points, BEARINGS, REACH), abs=KERNEL)


def test_behind_a_wall_and_behind_the_robot_nothing_is_free():
    seen = features(WALL)
    free = seen.free.reshape(BEARINGS, len(RANGES))
    assert free[0].tolist() == [1.0, 0.0, 0.0, 0.0], "0.4 m ahead is free, 0.8 m is too near the wall"
    assert free[BEARINGS // 4].all(), "along the wall"
    assert not free[BEARINGS // 2].any(), "the lidar does not see behind the robot"
    assert seen.scan[0] == pytest.approx(1.0 / REACH, abs=1e-3)
    assert seen.scan[BEARINGS // 2] == 1.0


def test_the_state_by_hand():
    seen = sight(World(), target=(0.0, 5.0), twist=Twist(0.25, -math.pi / 4))
    state = SubgoalInterface(load_settings("guide/learned_subgoal"), ROBOT).features(seen, seen.target).state
    limits = [0.5 / 2.0, math.pi / 2 / 4.0, 2.0 / 20.0, 2.0 / 25.0]
    assert state == pytest.approx([0.5, 0.0, 1.0, 0.5, -0.5, *limits, 0.0, 0.0], abs=KERNEL)


def test_shut_in_all_candidates_count_as_free_and_the_guide_says_that_it_is_blocked(tmp_path):
    shut = room(0.45)
    assert features(shut).free.all()
    guidance = guide(subgoal_file(tmp_path / "w.onnx")).guide(sight(shut))
    assert guidance.blocked


def test_a_mirrored_scene_has_mirrored_features():
    mirrored = World(circles=CLUTTER.circles * [1, -1, 1], segments=CLUTTER.segments * [1, -1, 1, -1])
    one, other = features(CLUTTER), features(mirrored)
    across = mirrored_bearings()
    assert other.scan == pytest.approx(one.scan[across], abs=MIRROR)
    grid = one.free.reshape(BEARINGS, len(RANGES))[across].reshape(CANDIDATES)
    assert 0.0 < grid.mean() < 1.0
    np.testing.assert_array_equal(other.free, grid)


def test_the_network_by_hand(tmp_path):
    weights = random_subgoal()
    rng = np.random.default_rng(1)
    scan, free, state = rng.random(BEARINGS), rng.integers(0, 2, CANDIDATES) * 1.0, rng.normal(size=11)
    values = np.concatenate([scan, [row.mean() for row in free.reshape(BEARINGS, -1)], state])
    for layer in LAYERS:
        values = values @ weights[f"{layer}.kernel"] + weights[f"{layer}.bias"]
        if layer != LAYERS[-1]:
            values = np.where(values > 0.0, values, SLOPE * values)
    logits = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, weights).answer(scan, free, state)[0]
    assert np.isneginf(logits[free == 0.0]).all()
    assert logits[free > 0.0] == pytest.approx(values[free > 0.0], abs=10 * FLOAT32_LAYER)


def test_candidates_are_drawn_by_their_probability_and_never_one_that_is_not_free():
    logits = np.log([0.25, 1.0, 0.75])
    logits[1] = -np.inf
    rng = np.random.default_rng(0)
    drawn = np.bincount([draw(logits, rng) for _ in range(4000)], minlength=3)
    assert drawn[1] == 0
    assert drawn[2] / 4000 == pytest.approx(0.75, abs=0.03)


def guide(path, robot=ROBOT, seed=0, **settings):
    made = LearnedSubgoal(load_settings("guide/learned_subgoal", weights=str(path), **settings), robot)
    made.reset(np.random.default_rng(seed))
    return made


def test_a_subgoal_stays_in_place_until_the_next_choice(tmp_path):
    """At 5 Hz and one second: the sixth step chooses again. The world frame shows that the subgoal does not move."""
    made = guide(subgoal_file(tmp_path / "w.onnx"), period=1.0)
    simulator = FastSimulator(load_settings("sim/fast"), ROBOT)
    seen = simulator.reset(task(CLUTTER), np.random.default_rng(0))
    places, switched = [], []
    for _ in range(7):
        guidance = made.guide(seen)
        x, y, yaw = simulator.state.pose
        ahead, left = guidance.subgoal
        places.append(
            (
                x + math.cos(yaw) * ahead - math.sin(yaw) * left,
                y + math.sin(yaw) * ahead + math.cos(yaw) * left,
            )
        )
        switched.append(guidance.switched)
        seen = simulator.step(Twist(0.4, 0.5))
    assert switched == [True, False, False, False, False, True, False]
    assert np.ptp(places[:5], axis=0).max() < 0.05, "to first order, as LME keeps its own"
    assert np.hypot(*(np.array(places[5]) - places[0])) > 0.1


def test_a_loaded_file_drives_the_same_to_the_last_bit(tmp_path):
    path = subgoal_file(tmp_path / "w.onnx", seed=3)
    again = tmp_path / "again.onnx"
    again.write_bytes(path.read_bytes())
    for name, array in read_weights(path, SIGNATURE.what, SHAPES).items():
        np.testing.assert_array_equal(array, {**random_subgoal(3)}[name])
    drives = []
    for file in (path, again):
        navigator, simulator = (
            Navigator(guide(file), Simple(load_settings("planner/simple"), ROBOT)),
            FastSimulator(load_settings("sim/fast"), ROBOT),
        )
        navigator.reset(np.random.default_rng(5))
        seen = simulator.reset(task(CLUTTER), np.random.default_rng(5))
        poses = []
        for _ in range(40):
            seen = simulator.step(navigator.act(seen))
            poses.append(simulator.state.pose)
        drives.append(poses)
    np.testing.assert_array_equal(*drives)


def test_a_wrong_file_is_one_line(tmp_path):
    path = network_file(tmp_path / "w.onnx")
    assert "is of the kind 'dclp': must be a subgoal network" in refused(guide, path)
    assert "hidden_1.kernel is missing: must be float32 (107, 128)" in refused(
        lambda path: read_weights(path, SIGNATURE.what, SHAPES), path
    )


def test_a_robot_that_the_network_was_not_trained_for_is_warned_of(tmp_path, says):
    weights = random_subgoal()
    weights[TRAINED][0] = [1.0, 2.0]
    path = tmp_path / "w.onnx"
    signed(SIGNATURE, path, write_weights, weights)
    with says.warns():
        guide(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        guide(subgoal_file(path))


def test_a_scan_without_returns_leaves_all_in_view_free():
    seen = observation(ranges=np.full(ROBOT.lidar.num_beams, np.nan, np.float32), robot=ROBOT)
    free = SubgoalInterface(load_settings("guide/learned_subgoal"), ROBOT).features(seen, seen.target).free
    assert free.reshape(BEARINGS, -1).all(axis=1).sum() == 37, "270° of 48 bearings, both edges included"
