import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.errors import InputError
from lme.perception.point_cloud import Projection, rigid_transform, to_scan
from lme.perception.raycast import cast_shapes
from lme.simulation.mid360.pattern import beam_pattern
from lme.simulation.mid360.sensor import ExtrudedWorld, Mid360, Mid360Config, mid360_of
from lme.types import Pose
from lme.worlds.world import World
from tests.builders import shipped
from tests.tolerances import RANGE

SEEDS = st.integers(0, 2**32 - 1)
ORIGIN = Pose(0.0, 0.0, 0.0)
LEVEL = [0.0, 0.0, 0.4, 0.0, 0.0, 0.0]
NOSE_DOWN = [0.1, 0.0, 0.4, 0.0, 0.35, 0.0]
OVER = [-0.1, 0.05, 0.45, math.pi, 0.3, 0.7]  # upside down, tilted and turned
BODY = Projection(min_height=0.1, max_height=0.6, range_min=0.1, range_max=20.0)


def square(x, y, half=0.25):
    return np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])


def sensor(mount=LEVEL, seed=0, **changes):
    """A sensor at the start of its pattern, without noise unless asked for."""
    made = Mid360(Mid360Config(mount=list(mount), **{"noise_std": 0.0, **changes}))
    made.reset(np.random.default_rng(seed))
    return made


def scan_of(scene, pose=ORIGIN, mount=LEVEL, projection=BODY, duration=0.25, **changes):
    """The planar scan of what a sensor sees in `duration` [s]."""
    return to_scan(sensor(mount, **changes).cloud(scene, pose, duration), projection, mount)


@settings(max_examples=20)
@given(SEEDS)
def test_every_beam_reads_what_the_planar_kernel_sees_between_it_and_the_next(seed):
    rng = np.random.default_rng(seed)
    bearings, distances = rng.uniform(-4, 4, 6), rng.uniform(1.0, 5.0, 6)
    circles = np.column_stack(
        [distances * np.cos(bearings), distances * np.sin(bearings), rng.uniform(0.05, 0.8, 6)]
    )
    world = World(circles=circles, polygons=(square(0, 0, 6.0),))
    pose = Pose(*rng.uniform(-0.05, 0.05, 2), rng.uniform(-4, 4))
    scan = scan_of(ExtrudedWorld(world), pose, duration=0.4, seed=seed)
    fine = cast_shapes(pose, (-math.pi, math.tau / 3600, 3600), 40.0, circles, world.edges).reshape(360, 10)
    before, after = np.roll(fine, 1, axis=0)[:, -1:], np.roll(fine, -1, axis=0)[:, :1]
    around = np.hstack([before, fine, after])
    # Between two bearings a tenth of a degree apart a wall at 45° and 6 m comes 2 cm nearer.
    assert (scan.ranges >= around.min(axis=1) - 0.05).all()
    assert (scan.ranges <= around.max(axis=1) + 0.05).all()


# ---- What becomes an obstacle

MOUNTS = pytest.mark.parametrize("mount", [LEVEL, NOSE_DOWN, OVER], ids=["level", "nose down", "upside down"])


def returns(scan):
    return np.isfinite(scan.ranges).sum()


@MOUNTS
def test_ground_and_ceiling_are_seen_but_are_not_obstacles(mount):
    empty = ExtrudedWorld(World(), ceiling=2.5)
    assert len(sensor(mount).cloud(empty, ORIGIN, 0.1)) > 5000
    assert returns(scan_of(empty, mount=mount)) == 0


@MOUNTS
def test_ground_is_not_an_obstacle_under_noise_either(mount):
    assert returns(scan_of(ExtrudedWorld(World(), ceiling=2.5), mount=mount, noise_std=0.02)) == 0


def test_a_tilt_that_the_transform_omits_makes_the_ground_a_wall():
    cloud = sensor(NOSE_DOWN).cloud(ExtrudedWorld(World()), ORIGIN, 0.25)
    assert returns(to_scan(cloud, BODY, NOSE_DOWN)) == 0
    assert returns(to_scan(cloud, BODY, LEVEL)) > 30


@MOUNTS
def test_a_table_above_the_robot_is_not_an_obstacle(mount):
    table = ExtrudedWorld(World(polygons=(square(0.0, 0.0, 3.0),)), polygons=(0.7, 0.75))
    above = Projection(min_height=0.65, max_height=0.8, range_max=20.0)
    assert returns(scan_of(table, mount=mount, projection=above)) > 5
    assert returns(scan_of(table, mount=mount)) == 0


@pytest.mark.parametrize("shape", ["polygon", "circle"])
@pytest.mark.parametrize(("height", "seen"), [(0.05, False), (0.2, True)])
def test_low_boxes_are_obstacles_down_to_the_lowest_height(shape, height, seen):
    polygon = World(polygons=(square(1.5, 0.0),))
    world = polygon if shape == "polygon" else World(circles=np.array([[1.5, 0.0, 0.25]]))
    scan = scan_of(ExtrudedWorld(world, circles=(0.0, height), polygons=(0.0, height)), mount=NOSE_DOWN)
    assert (returns(scan) > 10) == seen
    if seen:
        assert scan.ranges[180] == pytest.approx(1.25, abs=1e-4)
        low = Projection(min_height=height + 0.01, range_max=20.0)
        assert (
            returns(
                scan_of(
                    ExtrudedWorld(world, (0.0, height), (0, 1), (0.0, height)),
                    mount=NOSE_DOWN,
                    projection=low,
                )
            )
            == 0
        )


def test_a_level_sensor_overlooks_a_low_box_nearby_and_a_tilted_one_sees_it():
    # 7° below the horizon from 0.4 m up: at 1 m it sees what is higher than 0.28 m.
    box = ExtrudedWorld(World(polygons=(square(1.25, 0.0),)), polygons=(0.0, 0.2))
    assert returns(scan_of(box, mount=LEVEL)) == 0
    assert returns(scan_of(box, mount=NOSE_DOWN)) > 10


def test_a_box_seen_from_above_shows_its_lid():
    box = ExtrudedWorld(World(polygons=(square(1.5, 0.0),)), polygons=(0.0, 0.2))
    points = sensor(NOSE_DOWN).cloud(box, ORIGIN, 0.25) @ rigid_transform(NOSE_DOWN)[:3, :3].T
    heights = points[:, 2] + 0.4
    lid = points[np.abs(heights - 0.2) < 1e-5] + [0.1, 0.0, 0.4]
    assert len(lid) > 20
    assert (np.abs(lid[:, :2] - [1.5, 0.0]) <= 0.25 + 1e-5).all()


@settings(max_examples=20)
@given(SEEDS)
def test_the_transform_undoes_any_mount(seed):
    rng = np.random.default_rng(seed)
    mount = [
        *rng.uniform(-0.2, 0.2, 2),
        rng.uniform(0.2, 0.6),
        *rng.uniform(-0.5, 0.5, 2),
        rng.uniform(-4, 4),
    ]
    world = World(circles=np.array([[1.5, 0.5, 0.2]]), polygons=(square(-1.0, -1.5),))
    pose = Pose(*rng.uniform(-0.3, 0.3, 2), rng.uniform(-4, 4))
    points = sensor(mount, seed).cloud(ExtrudedWorld(world, circles=(0, 0.5), polygons=(0, 1.0)), pose, 0.02)
    to_base = rigid_transform(mount)
    to_world = rigid_transform([pose.x, pose.y, 0, 0, 0, pose.yaw]) @ to_base
    x, y, z = (points @ to_world[:3, :3].T + to_world[:3, 3]).T
    on_ground = np.abs(z) < 1e-4
    on_circle = (np.abs(np.hypot(x - 1.5, y - 0.5) - 0.2) < 1e-4) & (z < 0.5 + 1e-4)
    on_circle |= (np.hypot(x - 1.5, y - 0.5) < 0.2 + 1e-4) & (np.abs(z - 0.5) < 1e-4)
    off_box = np.maximum(np.abs(x + 1.0), np.abs(y + 1.5)) - 0.25
    on_box = (np.abs(off_box) < 1e-4) & (z < 1.0 + 1e-4)
    assert (on_ground | on_circle | on_box).all()


def scans_and_projections(std, x, y):
    """Three scans of a Go2's lidar at (x, y), each with the projection of the same cloud, seen from the base."""
    lidar = shipped("go2").lidar
    cloud = replace(lidar.cloud, x=x, y=y)
    lidar = replace(lidar, noise_std=std, cloud=cloud)
    world = World(circles=np.array([[1.5, 0.5, 0.2]]), polygons=(square(0.0, 0.0, 4.0),))
    pose = Pose(0.2, -0.1, 0.7)
    fast, slow = mid360_of(lidar), mid360_of(lidar)
    fast.reset(np.random.default_rng(3))
    slow.reset(np.random.default_rng(3))
    low, high = cloud.min_height, cloud.max_height
    keep = Projection(low, high, angle_increment=math.tau / 360, range_min=0.1, range_max=20.0)
    # The beams of the scan are the middles of its bins.
    half_bin = rigid_transform([0.0, 0.0, 0.0, 0.0, 0.0, math.pi / 360])
    turned = half_bin @ rigid_transform([x, y, cloud.height, 0.0, 0.0, 0.0])
    for _ in range(3):
        scan = fast.scan(lidar, pose, world.circles, world.edges)
        yield scan, to_scan(slow.cloud(ExtrudedWorld(world), pose, cloud.duration), keep, turned).ranges


def check_equal(scan, projection):
    off = np.abs(scan - projection)
    # A cloud is float32, so a point on the border of two bins may change sides.
    assert (off > 1e-5).sum() <= 2
    assert off.max() < 0.1


@pytest.mark.parametrize("std", [0.0, 0.02])
def test_the_mid360_scan_is_the_projection_of_its_cloud(std):
    for scan, projection in scans_and_projections(std, 0.0, 0.0):
        assert np.isfinite(scan).all()
        check_equal(scan, projection)


@pytest.mark.parametrize("std", [0.0, 0.02])
def test_the_scan_of_a_sensor_ahead_is_what_the_base_sees_but_for_the_shadow_of_the_disc(std):
    for scan, projection in scans_and_projections(std, 0.25, -0.1):
        assert np.array_equal(np.isnan(scan), np.isinf(projection))
        assert np.isnan(scan).sum() <= 2
        check_equal(scan[~np.isnan(scan)], projection[~np.isnan(scan)])


# ---- The sensor


@given(SEEDS)
def test_the_pattern_is_the_sequence_of_the_plastic_number(seed):
    rng = np.random.default_rng(seed)
    first, phase, elevations = int(rng.integers(0, 10**7)), rng.random(2), np.sort(rng.uniform(-1.5, 1.5, 2))
    rho = 1.324717957244746
    share = (phase + (first + np.arange(30))[:, None] / np.array([rho, rho**2])) % 1.0
    elevation = elevations[0] + (elevations[1] - elevations[0]) * share[:, 1]
    azimuth = 2 * math.pi * share[:, 0]
    expected = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    beams = beam_pattern(first, 30, tuple(phase), tuple(elevations))
    # A step that differs in its last digit is off by 10⁻⁹ of a turn after 10⁷ beams.
    assert beams == pytest.approx(np.array(expected).T, abs=2e-8)


def test_the_mid360_pattern_stays_in_the_field_of_view_and_covers_it():
    shell = ExtrudedWorld(World(circles=np.empty((0, 3))), ground=-5.0, ceiling=5.0)
    points = sensor(range_max=1e4).cloud(shell, ORIGIN, 0.5).astype(float)
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    assert elevation.min() == pytest.approx(-7.0, abs=0.01)
    assert elevation.max() == pytest.approx(52.0, abs=0.01)
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    assert np.histogram(azimuth, 360, (-180, 180))[0].min() > 200
    assert np.histogram(elevation, 59, (-7, 52))[0].min() > 1000


def test_the_mid360_pattern_does_not_repeat_and_fills_in():
    ceiling, eyes = ExtrudedWorld(World(), ceiling=3.0), sensor()
    frames = [np.round(eyes.cloud(ceiling, ORIGIN, 0.1), 3) for _ in range(5)]
    assert len(np.unique(np.vstack(frames), axis=0)) > 0.99 * sum(map(len, frames))


def test_equal_seeds_make_equal_clouds_and_others_differ():
    room = ExtrudedWorld(World(polygons=(square(0, 0, 3.0),)))
    first, again, other = (sensor(seed=seed, noise_std=0.02).cloud(room, ORIGIN, 0.05) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.array_equal(first, other)


def test_the_mid360_fires_at_its_rate_and_gives_no_point_for_a_miss():
    walls = ExtrudedWorld(World(circles=np.array([[0.0, 0.0, 3.0]])), circles=(-math.inf, math.inf))
    assert len(sensor().cloud(ExtrudedWorld(World(), ground=-math.inf), ORIGIN, 0.1)) == 0
    assert len(sensor().cloud(ExtrudedWorld(World(polygons=(square(0, 0, 3.0),))), ORIGIN, 0.1)) == 20_000
    assert len(sensor().cloud(walls, ORIGIN, 0.1)) == 0  # inside a solid: all in the blind zone


@pytest.mark.parametrize(("distance", "seen"), [(0.05, False), (0.2, True), (39.0, True), (41.0, False)])
def test_the_mid360_is_blind_nearby_and_beyond_its_range(distance, seen):
    wall = World(segments=np.array([[distance, -distance, distance, distance]]))
    scene = ExtrudedWorld(wall, segments=(0.39, 0.41), ground=-math.inf)
    assert (len(sensor().cloud(scene, ORIGIN, 1.0)) > 0) == seen


def test_noise_is_along_the_beam_and_as_large_as_it_says():
    room = ExtrudedWorld(World(polygons=(square(0, 0, 3.0),)))
    plain, noisy = (sensor(noise_std=std).cloud(room, ORIGIN, 0.1).astype(float) for std in (0.0, 0.02))
    gained = np.linalg.norm(noisy, axis=1) - np.linalg.norm(plain, axis=1)
    assert gained.std() == pytest.approx(0.02, rel=0.05)
    assert np.linalg.norm(np.cross(plain, noisy), axis=1).max() < 1e-4


@pytest.mark.parametrize(
    "arguments",
    [
        {"circles": [[0, 1], [0, 1]]},
        {"polygons": (1.0, 0.5)},
        {"circles": (0.0, math.nan)},
        {"ceiling": -1.0},
    ],
    ids=str,
)
def test_bad_scenes_are_named(arguments, says):
    world = World(circles=np.array([[1.0, 0.0, 0.1]]), polygons=(square(2.0, 0.0),))
    with says.raises(InputError):
        ExtrudedWorld(world, **arguments)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("mount", [0, 0, 0.4]),
        ("point_rate", 0.0),
        ("elevation_max", -1.0),
        ("range_max", 0.05),
        ("noise_std", -1.0),
    ],
    ids=str,
)
def test_bad_sensors_are_named(key, value, says):
    with says.raises(InputError):
        Mid360Config(**{"mount": LEVEL, key: value})


@given(SEEDS)
def test_beams_that_are_left_out_do_not_change_the_others(seed):
    rng = np.random.default_rng(seed)
    pose = rigid_transform([0.0, 0.0, 0.45, *rng.uniform(-0.2, 0.2, 2), rng.uniform(-3, 3)])
    circles, edges = np.array([[1.0, 0.5, 0.3, 0.0, 2.0]]), np.empty((0, 6))
    up, highest = pose[2, :3], rng.uniform(-0.1, 0.5)
    scene = circles, edges, np.empty((0, 4)), (0.0, 2.5)
    every, some = (
        sensor(noise_std=0.02, seed=seed).returns(pose, 0.01, *scene, up, most) for most in (1.0, highest)
    )
    kept = every[every @ up <= highest * np.linalg.norm(every, axis=1)]
    np.testing.assert_allclose(some, kept, rtol=0, atol=RANGE)
