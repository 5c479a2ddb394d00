"""A value that no robot has is refused, an unusual one gets a warning, and each names value, unit and usual range."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.config.systems import load_system
from lme.errors import InputError
from lme.inputs.plausibility import USUAL, check
from lme.live.config import CloudConfig, LiveConfig, ScanConfig, mount_of
from lme.robots import Cap, Cloud, Footprint, Lidar
from lme.types import Pose
from lme.worlds.check import check_task
from lme.worlds.cold_trial import drawn_robot
from lme.worlds.movers import Mover
from runners.recordings.map_build import BuildConfig
from tests.builders import stage, task

LIDAR = {"num_beams": 9, "fov": 2.0, "range_min": 0.1, "range_max": 5.0}


def test_every_usual_range_lies_within_the_possible_one():
    for usual in USUAL.values():
        assert usual.least <= usual.low < usual.high <= usual.most


def test_the_value_its_unit_and_the_usual_range_are_named(says):
    with says.warns():
        check("robot.alpha_v", 0.001)
    with says.raises(InputError):
        check("robot.control_rate", 0.05)


@pytest.mark.parametrize(
    "make",
    [
        lambda: stage(alpha_v=0.001),
        lambda: stage(omega_max=90.0),
        lambda: stage(control_rate=0.5),
        lambda: stage(v_max=50.0),
        lambda: Footprint(radius=35.0),
        lambda: Lidar(**LIDAR, yaw=90.0),
        lambda: Lidar(**LIDAR, noise_std=10.0),
        lambda: Lidar(**{**LIDAR, "range_max": 5600.0}),
        lambda: stage(lidar=Lidar(**LIDAR, x=3.0)),
        lambda: Cloud(45.0, 0.05, 0.5),
        lambda: load_settings("sim/fast", latency=50.0),
        lambda: load_settings("sim/physics", grip=5.0),
        lambda: load_settings("sim/skid", scan_noise=20.0),
        lambda: ScanConfig(mount=[0.1, 0.0, 0.3, 0.0, 0.0, 180.0]),
        lambda: ScanConfig(range_max=8000.0),
        lambda: ScanConfig(cloud=CloudConfig(angle_increment=0.5)),
        lambda: mount_of(ScanConfig(mount=[3.0, 0.0, 0.3, 0.0, 0.0, 0.0]), None, stage(), 0.0),
        lambda: LiveConfig(stale=30.0),
        lambda: LiveConfig(time_jump=1000.0),
        lambda: LiveConfig(goal_tolerance=200.0),
        lambda: Mover(np.zeros((2, 2)), radius=0.3, speed=130.0),
        lambda: check_task(task(start=Pose(0.0, 0.0, 90.0)), stage()),
        lambda: load_settings("map/traps", time_limit=1e12),
        lambda: load_system("simple", "stage", goal_tolerance=200.0),
        lambda: stage(settling_time=40.0),
        lambda: BuildConfig(radius=18.0),
        lambda: Cap(v_max=50.0),
    ],
)
def test_an_unusual_value_gets_a_warning(make, says):
    with says.warns():
        make()


@pytest.mark.parametrize("key", ["v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"])
@pytest.mark.parametrize("value", [1e-300, 1e-9, 1e300])
def test_no_robot_has_such_a_limit(key, value, says):
    with says.raises(InputError):
        stage(**{key: value})


@pytest.mark.parametrize(
    "make",
    [
        lambda: Footprint(length=420.0, width=310.0),
        lambda: stage(lidar=Lidar(**LIDAR, x=55.0)),
        lambda: Lidar(**{**LIDAR, "fov": 1e-300}),
        lambda: load_settings("sim/physics", substep=1e-12),
        lambda: load_settings("sim/skid", check_time=1e-9),
        lambda: load_settings("sim/fast", latency=1e300),
        lambda: LiveConfig(stale=500.0),
        lambda: stage(settling_time=400.0),
        lambda: mount_of(ScanConfig(mount=[55.0, 0.0, 300.0, 0.0, 0.0, 0.0]), None, stage(), 0.0),
        lambda: load_settings("sim/fast", slip=1e300),
    ],
)
def test_no_robot_and_no_simulator_is_so(make, says):
    with says.raises(InputError):
        make()


def test_the_draws_of_the_cold_trial_are_usual():
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for _ in range(500):
            robot = drawn_robot("drawn", load_settings("map/_cold_trial").ranges, rng)
    lidar = replace(robot.lidar, yaw=math.pi)
    assert replace(robot, lidar=lidar).lidar.yaw == math.pi
