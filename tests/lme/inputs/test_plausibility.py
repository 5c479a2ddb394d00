"""A value that no robot has is refused, an unusual one gets a warning, and each names value, unit and usual range."""

import math
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.inputs.plausibility import USUAL, check
from lme.live.config import ScanConfig
from lme.robots import Cloud, Footprint, Lidar
from lme.types import Pose
from lme.worlds.check import check_task
from lme.worlds.cold_trial import drawn_robot
from lme.worlds.movers import Mover
from tests.builders import stage, task

LIDAR = {"num_beams": 9, "fov": 2.0, "range_min": 0.1, "range_max": 5.0}


def test_every_usual_range_lies_within_the_possible_one():
    for usual in USUAL.values():
        assert usual.least <= usual.low < usual.high <= usual.most


def test_the_value_its_unit_and_the_usual_range_are_named():
    with pytest.warns(
        UserWarning, match=r"^robot\.alpha_v is 0\.001 m/s²: it is usually from 0\.05 to 50 m/s²$"
    ):
        check("robot.alpha_v", 0.001)
    said = (
        r"^robot\.control_rate is 0\.05 Hz: must be from 0\.1 to 1000 Hz, and is usually from 1 to 200 Hz; "
    )
    with pytest.raises(InputError, match=said):
        check("robot.control_rate", 0.05)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: stage(alpha_v=0.001), r"alpha_v is 0\.001 m/s²"),
        (lambda: stage(omega_max=90.0), r"omega_max is 90 rad/s: .* is it in degrees"),
        (lambda: stage(control_rate=0.5), r"control_rate is 0\.5 Hz"),
        (lambda: stage(v_max=50.0), r"v_max is 50 m/s"),
        (lambda: Footprint(radius=35.0), r"radius is 35 m: .* centimetres"),
        (lambda: Lidar(**LIDAR, yaw=90.0), r"yaw is 90 rad: .* degrees"),
        (lambda: Lidar(**LIDAR, noise_std=10.0), r"noise_std is 10 m"),
        (
            lambda: Lidar(**{**LIDAR, "range_max": 5600.0}),
            r"range_max is 5600 m: .* millimetres",
        ),
        (
            lambda: stage(lidar=Lidar(**LIDAR, x=3.0)),
            r"lidar is mounted 3 m from .* ends at 0\.2 m: .* 0\.4 m",
        ),
        (lambda: Cloud(45.0, 0.05, 0.5), r"height is 45 m"),
        (lambda: load_settings("sim/fast", latency=50.0), r"sim\.latency is 50 s: .* milliseconds"),
        (lambda: load_settings("sim/physics", grip=5.0), r"sim\.grip is 5: it is usually from 0\.05 to 2"),
        (lambda: load_settings("sim/skid", scan_noise=20.0), r"sim\.scan_noise is 20 m"),
        (lambda: ScanConfig(mount=[0.1, 0.0, 0.3, 0.0, 0.0, 180.0]), r"mount\.yaw is 180 rad"),
        (lambda: Mover(np.zeros((2, 2)), radius=0.3, speed=130.0), r"speed is 130 m/s"),
        (lambda: check_task(task(start=Pose(0.0, 0.0, 90.0)), stage()), r"start\.yaw is 90 rad: .* degrees"),
        (lambda: load_settings("map/traps", time_limit=1e12), r"map\.time_limit is 1e\+12 s"),
    ],
)
def test_an_unusual_value_gets_a_warning(make, said):
    with pytest.warns(UserWarning, match=said):
        make()


@pytest.mark.parametrize("key", ["v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"])
@pytest.mark.parametrize("value", [1e-300, 1e-9, 1e300])
def test_no_robot_has_such_a_limit(key, value):
    shown = re.escape(f"{value:g}")
    with pytest.raises(InputError, match=rf"^{key} is {shown} \S+: must be from"):
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
        lambda: load_settings("sim/fast", slip=1e300),
    ],
)
def test_no_robot_and_no_simulator_is_so(make):
    with pytest.raises(InputError, match=r"must be .*, and is usually"):
        make()


def test_the_draws_of_the_cold_trial_are_usual():
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for _ in range(500):
            robot = drawn_robot("drawn", load_settings("map/_cold_trial").ranges, rng)
    lidar = replace(robot.lidar, yaw=math.pi)
    assert replace(robot, lidar=lidar).lidar.yaw == math.pi
