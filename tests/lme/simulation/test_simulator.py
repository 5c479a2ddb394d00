from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.perception.resampling import resampled, tidied
from lme.perception.shadows import without_shadows
from lme.simulation.fast import FastSimulator
from lme.types import LaserScan, Twist
from lme.worlds.world import World
from tests.builders import shipped, task

ROOM = World(circles=np.array([[2.0, 0.5, 0.3]]), segments=np.array([[-3.0, -3.0, -3.0, 3.0]]))


def observed(robot, seed=0, world=ROOM, **config):
    """The observations of three steps ahead."""
    simulator = FastSimulator(load_settings("sim/fast", **config), robot)
    seen = [simulator.reset(task(world, goal=(8.0, 0.0)), np.random.default_rng(seed))]
    return seen + [simulator.step(Twist(0.2, 0.1)) for _ in range(3)]


@pytest.mark.parametrize("name", ["go2", "turtlebot2"])
def test_a_scan_is_float32_of_the_lidars_beams_and_the_same_for_the_same_seed(name):
    robot = shipped(name)
    first, again, other = (observed(robot, seed) for seed in (1, 1, 2))
    for one, two, three in zip(first, again, other, strict=True):
        assert one.scan.ranges.dtype == np.float32
        assert len(one.scan.ranges) == robot.lidar.num_beams
        np.testing.assert_array_equal(one.scan.ranges, two.scan.ranges)
        assert not np.array_equal(one.scan.ranges, three.scan.ranges)


@pytest.mark.parametrize("name", ["go2", "turtlebot2"])
def test_a_miss_is_inf_and_a_number_is_within_the_range(name):
    robot = shipped(name)
    for seen in observed(robot, scan_noise=0.05):
        ranges = seen.scan.ranges
        assert np.isinf(ranges).any()
        assert (ranges[np.isfinite(ranges)] < robot.lidar.range_max).all()


def test_a_cloud_and_a_planar_scanner_see_the_same_walls():
    robot = shipped("go2")
    planar = replace(robot, lidar=replace(robot.lidar, cloud=None, noise_std=0.0))
    for cloud, flat in zip(observed(robot), observed(planar), strict=True):
        both = np.isfinite(cloud.scan.ranges) & (flat.scan.ranges < robot.lidar.range_max)
        assert both.sum() > 40
        assert np.median(np.abs(cloud.scan.ranges - flat.scan.ranges)[both]) < 0.05


def test_beams_are_lost_with_the_configured_share():
    full, lost = (observed(shipped("go2"), scan_dropout=share)[0].scan.ranges for share in (0.0, 1.0))
    limit = shipped("go2").lidar.range_max
    assert (full < limit).any()
    assert not (lost < limit).any()


def test_simulation_interpolates_native_beams_as_a_replay_does():
    robot = shipped("turtlebot2")
    lidar = replace(robot.lidar, noise_std=0.0)
    native = lidar.native
    assert native.num_beams == 540
    fired = observed(replace(robot, lidar=native))[0].scan.ranges
    raw = LaserScan(fired, native.angle_min, native.angle_increment, native.range_min, native.range_max)
    seen = observed(replace(robot, lidar=lidar))[0].scan.ranges
    np.testing.assert_array_equal(seen, resampled(tidied(raw), lidar.mount, lidar).ranges)


def test_a_scan_without_shadows_is_that_of_the_filter():
    lidar = replace(shipped("turtlebot2").lidar, noise_std=0.0, fov=1.5 * np.pi)
    doors = [[2.0, y, 2.0, y + 0.13] for y in np.arange(-1.0, 1.0, 0.31)]
    world = World(segments=np.array([*doors, [5.0, -9.0, 5.0, 9.0]]))
    robots = [
        replace(shipped("turtlebot2"), lidar=replace(lidar, shadow_angle=angle)) for angle in (None, 0.17)
    ]
    plain, filtered = (observed(robot, world=world)[-1].scan for robot in robots)
    assert np.isnan(filtered.ranges).any()
    np.testing.assert_array_equal(filtered.ranges, without_shadows(plain, 0.17).ranges)
