"""Maps from logs of every kind, compared with the room in which they were made."""

import math

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("rosbags")

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import compose, relative
from lme.mapping.occupancy import FREE, OCCUPIED
from lme.types import Pose
from lme.worlds.room import MapFile
from runners.recordings.map_build import BuildConfig, build_map, check_target, describe, write_map
from runners.recordings.posed_scans import DriveLog, LogConfig, log_config
from tests.made_bags import BEGAN, MOUNT, OTHERS, SECOND, TF, BagMaker, drive, seen
from tests.made_bags import CIRCLES as BAG_CIRCLES
from tests.made_bags import way as bag_way
from tests.made_logs import flaser_lines, robotlaser_lines, truth_clearance, write


def places(built):
    """(P, 2) the middles of the cells, and the cells (P,)."""
    rows, columns = np.indices(built.map.cells.shape)
    points = (
        np.column_stack((columns.ravel(), rows.ravel())) + 0.5
    ) * built.map.resolution + built.map.origin
    return points, built.map.cells.ravel()


def hall_clearance(points):
    """Distance to the walls and discs of tests.made_bags [m]; negative in a disc or outside."""
    to_walls = np.min(
        [points[:, 0] + 3.0, 8.0 - points[:, 0], points[:, 1] + 3.0, 3.0 - points[:, 1]], axis=0
    )
    return np.min([to_walls, *(np.hypot(*(points - (x, y)).T) - r for x, y, r in BAG_CIRCLES)], axis=0)


@pytest.mark.parametrize(
    "lines", [flaser_lines(rng=np.random.default_rng(0)), robotlaser_lines()], ids=["FLASER", "ROBOTLASER1"]
)
def test_the_map_of_a_carmen_log_is_the_room(tmp_path, lines):
    built = build_map([write(tmp_path / "room.log.gz", lines)], BuildConfig(), shown=False)
    points, cells = places(built)
    clearance = truth_clearance(points)
    in_room = (points > 0.0).all(axis=1) & (points < (10.0, 6.0)).all(axis=1)
    assert (cells == FREE)[in_room & (clearance > 0.3)].all()
    assert not ((cells == FREE) & ~in_room & (clearance > 0.08) & (points[:, 1] > 0.0)).any()
    assert (clearance[cells == OCCUPIED] < 0.1).all()
    assert built.skipped == 0


# Seen from above the beams of a lidar that hangs upside down run clockwise.
HANGING = {"roll": math.pi, "first": -math.pi + math.pi / 360, "spoil": lambda ranges: ranges[::-1]}
RECORDINGS = {**OTHERS, "plain": {}, "upside down": HANGING}


@pytest.mark.parametrize("other", RECORDINGS.values(), ids=RECORDINGS)
def test_the_map_of_any_recording_is_the_hall(tmp_path, other):
    """Clockwise, upside down or rotated lidars, and poses from any source: free is what is free there."""
    path = drive(".mcap", steps=60, **other).write(tmp_path)
    built = build_map([path], BuildConfig(no_returns="ignore"), shown=False)
    points, cells = places(built)
    clearance = hall_clearance(points)
    assert built.scans >= 59
    assert (clearance[cells == FREE] > -0.1).all()
    assert (np.abs(clearance[cells == OCCUPIED]) < 0.1).all()
    assert built.map.free_area > 30.0


@pytest.mark.parametrize("suffix", [".bag", ".db3"])
def test_the_other_formats_give_the_same_map(tmp_path, suffix):
    one = build_map([drive(".mcap", steps=20).write(tmp_path)], BuildConfig(), shown=False)
    other = build_map([drive(suffix, steps=20).write(tmp_path, "other")], BuildConfig(), shown=False)
    assert (one.map.cells == other.map.cells).all()


def test_a_log_of_scans_that_measure_nothing_is_warned_of_and_counted(tmp_path, says):
    path = drive(".mcap", steps=20, spoil=lambda ranges: ranges * np.nan).write(tmp_path)
    with says.warns():
        built = build_map([path], BuildConfig(), shown=False)
    says(built.tally)


def test_a_point_cloud_gives_a_map_too(tmp_path):
    built = build_map([drive(".mcap", steps=30, scans="cloud").write(tmp_path)], BuildConfig(), shown=False)
    points, cells = places(built)
    assert (hall_clearance(points)[cells == FREE] > -0.1).all()
    assert built.map.free_area > 20.0


def corrected(ahead_s=1.0, drift=0.02):
    """A drive whose odometry drifts, and a localiser that corrects it in the frame map, stamped in the future."""
    made = BagMaker(".mcap")
    made.add("/tf_static", TF, BEGAN, made.transform(0, "base_link", "laser", MOUNT))
    for k, (pose, v, omega) in enumerate(bag_way(60)):
        now = BEGAN + k * SECOND // 10
        odom = compose(Pose(0.0, 0.0, drift * k), pose)
        made.add("/odom", "nav_msgs/msg/Odometry", now, made.odometry(now, odom, v, omega))
        inverse = relative(Pose(0.0, 0.0, 0.0), odom)
        correction = compose(pose, inverse)
        made.add("/tf", TF, now, made.transform(now + round(ahead_s * SECOND), "map", "odom", correction))
        made.add("/tf", TF, now, made.transform(now, "odom", "base_link", odom))
        made.add(
            "/scan", "sensor_msgs/msg/LaserScan", now, made.scan(now, seen(pose), -np.pi, 2 * np.pi / 360)
        )
    return made


def test_poses_in_the_frame_map_are_preferred(tmp_path):
    path = corrected().write(tmp_path)
    built = build_map([path], BuildConfig(), shown=False)
    assert "tf (map to base_link)" in built.sources
    points, cells = places(built)
    sharp = np.abs(hall_clearance(points)[cells == OCCUPIED])
    assert (sharp < 0.12).all()
    by_odometry = build_map(
        [path], BuildConfig(log=log_config({"frames": {"odom": "odom"}}, None)), shown=False
    )
    assert "/odom (odom to base_link)" in by_odometry.sources
    blurred = np.abs(hall_clearance(places(by_odometry)[0])[by_odometry.map.cells.ravel() == OCCUPIED])
    assert np.percentile(blurred, 90) > 3 * np.percentile(sharp, 90)


def test_several_logs_of_a_drive_make_one_map(tmp_path):
    lines = flaser_lines()
    half = len(lines) // 2
    whole = build_map([write(tmp_path / "whole.log", lines)], BuildConfig(), shown=False)
    parts = [write(tmp_path / f"{k}.log", part) for k, part in enumerate((lines[:half], lines[half:]))]
    assert (build_map(parts, BuildConfig(), shown=False).map.cells == whole.map.cells).all()


def test_a_part_of_a_log_makes_a_smaller_map(tmp_path):
    path = write(tmp_path / "a.log", flaser_lines())
    part = build_map([path], BuildConfig(log=log_config({"start": 0, "end": 15.5}, None)), shown=False)
    assert part.scans == 16
    assert "from 16 scans" in describe(part)


def test_the_lidar_is_where_the_named_robot_has_it(tmp_path):
    """A recording without tf does not say: without a name it is at the middle."""
    made = BagMaker(".mcap")
    for k, (pose, v, omega) in enumerate(bag_way(3)):
        now = BEGAN + k * SECOND // 10
        made.add("/odom", "nav_msgs/msg/Odometry", now, made.odometry(now, pose, v, omega))
        made.add(
            "/scan", "sensor_msgs/msg/LaserScan", now, made.scan(now, seen(pose), -np.pi, 2 * np.pi / 360)
        )
    path = made.write(tmp_path)
    for robot, x in ((None, 0.0), ("jackal", 0.055)):
        with DriveLog(path, LogConfig(robot=robot)) as log:
            first = next(log.scans())
        assert relative(first.lidar, first.base).x == pytest.approx(x, abs=1e-6)
    with (
        pytest.raises(InputError, match="robot is 'jackall'"),
        DriveLog(path, LogConfig(robot="jackall")) as log,
    ):
        next(log.scans())


def test_a_robot_drives_in_the_written_map(tmp_path):
    built = build_map([write(tmp_path / "room.log", flaser_lines())], BuildConfig(), shown=False)
    target = tmp_path / "maps" / "room.yaml"
    write_map(built, target)
    assert {file.name for file in target.parent.iterdir()} == {"room.yaml", "room.png", "room_way.png"}
    image = Image.open(target.with_suffix(".png"))
    assert np.array_equal(np.array(image)[::-1], built.map.cells)
    maps = MapFile(
        load_settings(
            "map/file", path=str(target), start=[1.5, 1.0], goal=[8.0, 1.0], radius=0.25, time_limit=90.0
        )
    )
    task = maps.task(0)
    around = np.hypot(3.5, 2.5) + np.hypot(3.0, 2.5)  # past the end of the wall
    assert around < task.shortest_path_length < around + 1.0


def test_the_picture_shows_the_way(tmp_path):
    built = build_map([write(tmp_path / "room.log", flaser_lines())], BuildConfig(), shown=False)
    write_map(built, tmp_path / "room.yaml")
    pixels = np.array(Image.open(tmp_path / "room_way.png").convert("RGB")).reshape(-1, 3).astype(int)
    blue = (np.abs(pixels - (0, 0x72, 0xB2)) < 8).all(axis=1)
    assert blue.sum() > 1000
    assert (pixels == 255).all(axis=1).mean() > 0.3


def test_a_map_is_not_replaced_by_mistake(tmp_path):
    for name in ("a.yaml", "b.png", "c_way.png"):
        (tmp_path / name).write_text("mine")
        target = tmp_path / f"{name[0]}.yaml"
        with pytest.raises(InputError, match=f"{name} exists; add --overwrite"):
            check_target(target, overwrite=False)
        check_target(target, overwrite=True)
    with pytest.raises(InputError, match=r"must end in \.yaml"):
        check_target(tmp_path / "a.png", overwrite=False)


@pytest.mark.parametrize(
    "settings",
    [
        {"topic": {}},
        {"topics": {"scans": "/a"}},
        {"start": "soon"},
        {"start": -1.0},
        {"start": 5.0, "end": 3.0},
        {"clock": "mine"},
        {"scan": {"mount": [1.0]}},
    ],
    ids=str,
)
def test_a_wrong_setting_is_one_line(settings, says):
    with says.raises(InputError):
        log_config(settings, None)


def test_a_log_without_poses_near_its_scans_is_one_line(tmp_path, says):
    made = BagMaker(".mcap")
    made.add("/odom", "nav_msgs/msg/Odometry", BEGAN, made.odometry(BEGAN, Pose(0.0, 0.0, 0.0), 0.0, 0.0))
    for k in range(3):
        now = BEGAN + (k + 5) * SECOND
        made.add("/scan", "sensor_msgs/msg/LaserScan", now, made.scan(now, np.ones(9), -1.0, 0.25))
    with says.raises(InputError):
        build_map([made.write(tmp_path)], BuildConfig(), shown=False)


def test_a_recording_without_poses_or_scans_is_one_line(tmp_path):
    made = BagMaker(".mcap")
    made.add("/scan", "sensor_msgs/msg/LaserScan", BEGAN, made.scan(BEGAN, np.ones(9), -1.0, 0.25))
    with pytest.raises(InputError, match="no poses"):
        build_map([made.write(tmp_path, "a")], BuildConfig(), shown=False)
    other = BagMaker(".mcap")
    other.add("/odom", "nav_msgs/msg/Odometry", BEGAN, other.odometry(BEGAN, Pose(0.0, 0.0, 0.0), 0.0, 0.0))
    with pytest.raises(InputError, match="no scans"):
        build_map([other.write(tmp_path, "b")], BuildConfig(), shown=False)


def test_a_resolution_too_fine_for_a_map_is_one_line(tmp_path, monkeypatch, says):
    monkeypatch.setattr("runners.recordings.map_build.MAX_PIXELS", 10_000)
    with says.raises(InputError):
        build_map([write(tmp_path / "a.log", flaser_lines())], BuildConfig(), shown=False)


@pytest.mark.parametrize("key", ["resolution", "max_range", "radius", "reach"])
def test_a_length_must_be_positive(key, says):
    with says.raises(InputError):
        BuildConfig(**{key: 0.0})
    with says.raises(InputError):
        BuildConfig(no_returns="maybe")
