"""What a robot may be, and what follows from its footprint and lidar."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.navigation.episode import run_episode
from lme.robots import Cloud, Footprint, Lidar
from lme.simulation.fast import FastSimulator
from lme.types import Limits, Outcome, Pose
from lme.worlds.barn.map_set import Barn
from tests.builders import SHIPPED, navigator, shipped, stage
from tests.tolerances import KERNEL

LIDAR = {"num_beams": 9, "fov": 2.0, "range_min": 0.1, "range_max": 5.0}


@pytest.mark.parametrize("key", ["v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_limit_must_be_positive_and_finite(key, value, says):
    with says.raises(InputError, match=f"{key}.*{value:g}"):
        stage(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("num_beams", 0),
        ("num_beams", 1),
        ("num_beams", 360.5),
        ("native_beams", 720.5),
        ("fov", 0.0),
        ("fov", -1.0),
        ("fov", 360.0),
        ("fov", math.nan),
        ("range_min", -0.1),
        ("range_min", math.nan),
        ("range_max", 0.1),
        ("range_max", 0.05),
        ("range_max", math.inf),
        ("noise_std", -0.01),
        ("noise_std", math.inf),
    ],
    ids=str,
)
def test_an_impossible_lidar_is_refused(key, value, says):
    with says.raises(InputError, match=f"{key}.*{value:g}"):
        Lidar(**{**LIDAR, key: value})


@pytest.mark.parametrize(("key", "value"), [("lidar", None), ("lidar", {"num_beams": 9}), ("footprint", 0.2)])
def test_a_part_of_a_robot_is_built_first(key, value, says):
    with says.raises(InputError, match=f"{key} is "):
        stage(**{key: value})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("height", 0.0),
        ("max_height", 0.0),
        ("duration", -1.0),
    ],
    ids=str,
)
def test_an_impossible_cloud_is_refused(key, value, says):
    with says.raises(InputError):
        Cloud(**{"height": 0.4, "min_height": 0.05, "max_height": 0.5, key: value})


@pytest.mark.parametrize(("keys", "value"), [({}, "0"), ({}, "1"), ({"cloud": Cloud(0.4, 0.1, 0.5)}, "0.2")])
def test_an_angle_of_shadows_is_small_and_belongs_to_a_planar_scanner(says, keys, value):
    with says.raises(InputError, match=f"shadow_angle is {value}"):
        Lidar(**{**LIDAR, "fov": math.tau}, **keys, shadow_angle=float(value))


@pytest.mark.parametrize("key", ["x", "y", "yaw"])
def test_the_scan_of_a_cloud_is_seen_from_the_base(key, says):
    cloud = Cloud(height=0.4, min_height=0.05, max_height=0.5, x=0.3)
    lidar = Lidar(**{**LIDAR, "fov": math.tau}, cloud=cloud)
    assert lidar.mount == (0.0, 0.0, 0.0)
    assert lidar.sensor == (0.3, 0.0, 0.0)
    with says.raises(InputError, match=f"{key} is 0.3"):
        replace(lidar, **{key: 0.3})


def test_a_cloud_makes_a_full_circle_and_native_beams_are_at_least_two(says):
    cloud = Cloud(height=0.4, min_height=0.05, max_height=0.5)
    with says.raises(InputError):
        Lidar(**LIDAR, cloud=cloud)
    with says.raises(InputError, match="native_beams.*1"):
        Lidar(**LIDAR, native_beams=1)


@pytest.mark.parametrize("key", ["radius", "length", "width"])
@pytest.mark.parametrize("value", [0.0, -0.2, math.nan, math.inf])
def test_a_footprint_must_have_an_extent(key, value, says):
    sides = {"radius": value} if key == "radius" else {"length": 0.4, "width": 0.3, key: value}
    with says.raises(InputError, match=f"{key}.*{value:g}"):
        Footprint(**sides)


@pytest.mark.parametrize(
    "sides",
    [
        {},
        {"length": 0.4},
        {"width": 0.3},
        {"radius": 0.2, "length": 0.4},
        {"radius": 0.2, "length": 0.4, "width": 0.3},
    ],
)
def test_a_footprint_is_either_a_disc_or_a_rectangle(sides, says):
    with says.raises(InputError):
        Footprint(**sides)


def test_inner_and_outer_radius():
    # Half of 0.42 × 0.31: min is 0.155, diagonal √(0.21² + 0.155²) = 0.26101.
    disc, rectangle = Footprint(radius=0.2), Footprint(length=0.42, width=0.31)
    assert (disc.inscribed_radius, disc.circumscribed_radius) == (0.2, 0.2)
    assert disc.box == (0.0, 0.0, 0.2)
    assert rectangle.inscribed_radius == pytest.approx(0.155, abs=KERNEL)
    assert rectangle.circumscribed_radius == pytest.approx(0.26101, abs=1e-5)
    assert rectangle.box == (0.21, 0.155, 0.0)
    assert Footprint(length=0.31, width=0.42).inscribed_radius == pytest.approx(0.155, abs=KERNEL)


@given(st.floats(0.01, 3), st.floats(0.01, 3), st.floats(0, 2 * math.pi))
def test_the_outline_lies_between_the_two_radii(length, width, bearing):
    footprint = Footprint(length=length, width=width)
    cos, sin = abs(math.cos(bearing)), abs(math.sin(bearing))
    to_outline = min(length / 2 / cos if cos else math.inf, width / 2 / sin if sin else math.inf)
    assert footprint.inscribed_radius - KERNEL <= to_outline <= footprint.circumscribed_radius + KERNEL


BODY = {"length": 0.42, "width": 0.31}


@pytest.mark.parametrize("radius", [0.154, 0.0, -1.0])
def test_a_collision_radius_below_the_inner_radius_is_an_error(radius):
    with pytest.raises(
        InputError, match=rf"^collision_radius is {radius:g} m, .*at least 0\.155, better 0\.261"
    ):
        stage(footprint=Footprint(**BODY), collision_radius=radius)


@pytest.mark.parametrize("radius", [0.155, 0.2, 0.26])
def test_a_collision_radius_between_the_radii_has_a_note(radius, says):
    robot = stage(footprint=Footprint(**BODY), collision_radius=radius)
    says(robot.radius_note)
    assert "0.261 m" in robot.radius_note
    assert robot.r == radius


@pytest.mark.parametrize("radius", [None, 0.2611, 0.5])
def test_a_collision_radius_that_covers_the_footprint_or_is_not_set_passes_in_silence(radius):
    robot = stage(footprint=Footprint(**BODY), collision_radius=radius)
    assert robot.radius_note == ""
    assert robot.r == (robot.footprint.circumscribed_radius if radius is None else radius)


@pytest.mark.parametrize("radius", [math.nan, math.inf])
def test_a_collision_radius_is_a_finite_number(radius):
    with pytest.raises(InputError, match=r"^collision_radius is"):
        stage(collision_radius=radius)


def test_a_full_circle_does_not_repeat_its_first_beam_and_an_arc_has_both_ends():
    full, arc = Lidar(**{**LIDAR, "fov": 2 * math.pi}), Lidar(**LIDAR)
    assert full.full_circle
    assert not arc.full_circle
    assert full.angle_increment == pytest.approx(2 * math.pi / 9, abs=KERNEL)
    assert arc.angle_increment == pytest.approx(2.0 / 8, abs=KERNEL)
    assert (full.angle_min, arc.angle_min) == (-math.pi, -1.0)
    assert Lidar(**{**LIDAR, "fov": 6.2831853}).full_circle  # as people write it
    assert not Lidar(**{**LIDAR, "fov": 6.28}).full_circle


def test_mount_limits_and_period():
    robot = stage(lidar=Lidar(**LIDAR, x=0.1, y=-0.2, yaw=0.3))
    assert robot.lidar.mount == Pose(0.1, -0.2, 0.3)
    assert robot.limits == Limits(0.5, math.pi / 2, 2.0, 2.0)
    assert robot.dt == 0.2


def test_shipped_robots_are_those_of_the_paper():
    # §IV.A, §IV.B, §V.A, §V.B.
    assert set(SHIPPED) >= {"stage", "jackal", "turtlebot2", "go2"}
    stage_robot, jackal, go2 = shipped("stage"), shipped("jackal"), shipped("go2")
    assert (stage_robot.r, stage_robot.control_rate) == (0.2, 5.0)
    lidar = stage_robot.lidar
    assert (lidar.num_beams, lidar.range_max, lidar.full_circle) == (540, 15.0, True)
    assert (jackal.footprint.length, jackal.footprint.width, jackal.v_max) == (0.42, 0.31, 2.0)
    assert jackal.r == pytest.approx(0.261, abs=1e-3)
    assert shipped("turtlebot2").lidar.num_beams == 270
    assert (go2.v_max, go2.control_rate, go2.r) == (0.66, 8.0, 0.3)


@pytest.mark.parametrize("name", SHIPPED)
def test_each_shipped_robot_drives_in_a_barn_world(name):
    robot = shipped(name)
    barn = Barn(load_settings("map/barn", worlds=[200], time_limit=40.0))
    episode = run_episode(
        barn.task(200),
        navigator(robot),
        FastSimulator(load_settings("sim/fast"), robot),
        np.random.default_rng(0),
    )
    assert episode.outcome in Outcome
    assert episode.path_length > 2.0
    assert 0 < episode.steps <= 40.0 * robot.control_rate + robot.control_rate * 10
    assert np.isfinite(episode.trajectory[:-1]).all()
    v, omega = episode.trajectory[:, 4:6].T
    assert np.abs(v).max() <= robot.v_max + KERNEL
    assert np.abs(omega).max() <= robot.omega_max + KERNEL
    assert (episode.min_clearance == 0.0) == (episode.outcome is Outcome.COLLISION)
