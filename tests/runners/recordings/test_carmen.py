"""Reading CARMEN logs: as ROS recordings, without rosbags, and with one clear line for whatever is wrong."""

import gzip
import math
from itertools import pairwise

import numpy as np
import pytest

from lme.errors import InputError
from lme.live.frames import FramesConfig
from lme.live.messages import SECOND, scan_of
from lme.types import Pose
from runners.cli.commands.replay import main
from runners.recordings.bags import Bag
from runners.recordings.carmen import ENDINGS, CarmenLog
from runners.recordings.recording import inspect, open_recording
from runners.recordings.topics import BagTopicsConfig, choose
from tests.made_logs import MOUNT, flaser_lines, robotlaser_lines, scan, way, write


def poses_of(log):
    recording = inspect(log, choose(log, BagTopicsConfig(), None), FramesConfig(), "auto")
    tree = recording.tree.copy()
    found = [recording.pose(message, tree) for message in log.messages(["/pose"])]
    return recording, [one.pose for one in found]


def assert_on_the_way(poses):
    off = np.array(poses) - way()
    off[:, 2] = np.remainder(off[:, 2] + math.pi, math.tau) - math.pi
    assert np.abs(off).max() < 1e-5


@pytest.mark.parametrize("name", ["drive.log", "drive.log.gz", "drive.clf", "drive.CLF.GZ"])
def test_scans_and_poses_of_flaser_lines(tmp_path, name):
    """The poses are those of the scans, not those of the ODOM lines."""
    log = open_recording(write(tmp_path / name.lower(), flaser_lines()).rename(tmp_path / name))
    recording, poses = poses_of(log)
    assert recording.frames == ("odom", "base_link")
    assert_on_the_way(poses)
    first = scan_of(recording.first_scan.content)
    assert np.allclose(first.ranges, scan(way()[0], 181), atol=1e-3)
    assert (first.angle_min, first.angle_increment) == pytest.approx((-math.pi / 2, math.pi / 180))
    assert recording.mount == pytest.approx(np.eye(4))
    assert (log.start, log.end) == (SECOND, len(way()) * SECOND)
    assert log.duration_s == len(way()) - 1


@pytest.mark.parametrize(("beams", "degrees"), [(180, 1.0), (181, 1.0), (360, 0.5), (361, 0.5)])
def test_the_usual_numbers_of_beams(tmp_path, beams, degrees):
    log = CarmenLog(write(tmp_path / "a.log", flaser_lines(way()[:2], beams)))
    content = next(log.messages(["/scan"])).content
    assert len(content.ranges) == beams
    assert math.degrees(content.angle_increment) == pytest.approx(degrees)


FOVS = [
    *[(101, 100.0, 1.0), (201, 100.0, 0.5), (401, 100.0, 0.25), (91, 180.0, 2.0), (721, 180.0, 0.25)],
    *[(271, 270.0, 1.0), (541, 270.0, 0.5), (1081, 270.0, 0.25), (540, 269.5, 0.5), (1080, 269.75, 0.25)],
    *[(682, 239.4, 0.3516), (683, 239.8, 0.3516), (769, 270.0, 0.3516)],
]


@pytest.mark.parametrize(("beams", "fov", "degrees"), FOVS)
def test_a_number_of_beams_says_the_field_of_view(tmp_path, beams, fov, degrees):
    """SICK and Hokuyo: not all of them see half a turn."""
    log = CarmenLog(write(tmp_path / "a.log", flaser_lines(way()[:2], beams)))
    content = next(log.messages(["/scan"])).content
    increment = math.degrees(content.angle_increment)
    assert increment == pytest.approx(degrees, abs=1e-4)
    assert (beams - 1) * increment == pytest.approx(fov, abs=0.1)
    ahead = -math.degrees(content.angle_min) - 0.5 * (beams - 1) * increment
    assert ahead == pytest.approx(0.5 * increment if beams % 20 == 0 else 0.0, abs=1e-6)


def test_an_unknown_number_of_beams_needs_the_increment(tmp_path, says):
    lines = flaser_lines(way()[:2], 500)
    path = write(tmp_path / "a.log", lines)
    with says.raises(InputError) as error:
        CarmenLog(path)
    assert str(path) in str(error.value)
    log = CarmenLog(write(path, ["PARAM laser_front_laser_resolution 0.5 nohost 0", *lines]))
    content = next(log.messages(["/scan"])).content
    assert math.degrees(content.angle_increment) == pytest.approx(0.5)
    assert math.degrees(content.angle_min) == pytest.approx(-0.5 * 499 / 2)
    for wrong in ("1.0", "x", "0", "nan"):
        with pytest.raises(InputError, match="500 beams"):
            CarmenLog(write(path, [f"PARAM laser_front_laser_resolution {wrong}", *lines]))


def test_robotlaser_lines_say_their_geometry_and_where_the_laser_is(tmp_path):
    log = CarmenLog(write(tmp_path / "a.log", robotlaser_lines(beams=91)))
    recording, poses = poses_of(log)
    assert_on_the_way(poses)
    assert recording.mount[:2, 3] == pytest.approx(MOUNT[:2], abs=1e-5)
    first = scan_of(recording.first_scan.content)
    assert (first.angle_increment, first.range_max) == pytest.approx((math.pi / 90, 30.0))


def test_if_only_the_pose_of_the_laser_is_corrected_it_alone_counts(tmp_path):
    lines = []
    for k, line in enumerate(flaser_lines()):
        words = line.split()
        if words[0] == "FLASER":
            words[-6] = str(float(words[-6]) + 0.1 * k)  # x of the robot by odometry
        lines.append(" ".join(words))
    recording, poses = poses_of(CarmenLog(write(tmp_path / "a.log", lines)))
    assert recording.mount == pytest.approx(np.eye(4))
    assert_on_the_way(poses)


def test_a_time_that_goes_backwards_is_said(tmp_path, says):
    """The scans after it would be left out of a replay, since they all count as taken at once."""
    lines = [line for line in flaser_lines() if line.startswith("FLASER")]
    restarted = [" ".join([*line.split()[:-3], str(k % 40), "host", "0"]) for k, line in enumerate(lines)]
    with says.warns():
        CarmenLog(write(tmp_path / "a.log", restarted))


@pytest.mark.parametrize("times", [lambda k: 1.0, lambda k: -k, lambda k: 4294970001.82 if k == 3 else k])
def test_times_that_are_no_use_become_an_order(tmp_path, times):
    """Some logs have one time for all scans, or a wild one in between: the order of the lines is right."""
    lines = [
        " ".join([*line.split()[:-3], str(times(k)), "host", "0"]) for k, line in enumerate(flaser_lines())
    ]
    _, poses = poses_of(log := CarmenLog(write(tmp_path / "a.log", lines)))
    assert_on_the_way(poses)
    stamps = [message.recorded for message in log.messages(["/scan"])]
    assert all(a < b for a, b in pairwise(stamps))


def test_of_two_kinds_of_lines_the_more_frequent_counts(tmp_path):
    log = CarmenLog(write(tmp_path / "a.log", [*robotlaser_lines()[:3], *flaser_lines()]))
    assert [topic.number for topic in log.topics()] == [len(way()), len(way()), 1]


def test_the_endings_are_those_that_a_message_names(tmp_path):
    path = tmp_path / "picture.png"
    path.touch()
    with pytest.raises(InputError) as error:
        Bag(path)
    assert str(error.value).endswith(f"or a CARMEN log ({', '.join(ENDINGS)})")


def test_a_part_of_a_log(tmp_path):
    log = CarmenLog(write(tmp_path / "a.log", flaser_lines()))
    part = list(log.messages(["/scan"], start=5 * SECOND, stop=9 * SECOND))
    assert [message.recorded // SECOND for message in part] == [5, 6, 7, 8]


def test_a_log_that_was_cut_off_is_read_up_to_there(tmp_path):
    lines = flaser_lines()
    log = CarmenLog(write(tmp_path / "a.log", [*lines[:-1], lines[-1][:300]]))
    assert log.topics()[0].number == len(way()) - 1


@pytest.mark.parametrize(
    "lines",
    [
        [""],
        ["ODOM 0 0 0 0 0 0 1 host 1"],
        ["FLASER 181 1.0 2.0"],
        [flaser_lines()[3].replace(" 1.", " x."), "PARAM a b"],
        [flaser_lines()[3].replace("FLASER 181", "FLASER 1"), "PARAM a b"],
        [robotlaser_lines()[0].replace(" 30.0 0.01", " x 0.01"), "a"],
    ],
)
def test_what_is_wrong_with_a_log_is_one_line(tmp_path, lines, says):
    path = write(tmp_path / "a.log", lines)
    with says.raises(InputError) as error:
        CarmenLog(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_files_that_cannot_be_read(tmp_path, says):
    with pytest.raises(InputError, match="no such file"):
        CarmenLog(tmp_path / "a.log")
    (tmp_path / "b.log").mkdir()
    with pytest.raises(InputError, match="is a directory"):
        CarmenLog(tmp_path / "b.log")
    (tmp_path / "c.log.gz").write_text("FLASER")
    with says.raises(InputError):
        CarmenLog(tmp_path / "c.log.gz")
    whole = gzip.compress("\n".join(flaser_lines()).encode())
    (tmp_path / "d.log.gz").write_bytes(whole[: len(whole) // 2])
    with says.raises(InputError):
        CarmenLog(tmp_path / "d.log.gz")


def test_replay_lists_the_topics_of_a_log(tmp_path, capsys):
    path = write(tmp_path / "a.log.gz", flaser_lines())
    assert main([str(path), "list=true"]) == 0
    out = capsys.readouterr().out
    assert "/scan" in out
    assert "sensor_msgs/msg/LaserScan" in out


def test_a_packed_log_that_ends_with_a_terabyte_of_zeros_is_refused(tmp_path):
    path = tmp_path / "drive.log.gz"
    path.write_bytes(gzip.compress(b"# CARMEN\n"))
    with path.open("r+b") as file:
        file.truncate(2**40)
    with pytest.raises(InputError, match=r"drive\.log\.gz: has 1099511627776 bytes"), CarmenLog(path):
        pass


def test_times_in_milliseconds_are_one_line(tmp_path, monkeypatch, says, capsys):
    monkeypatch.chdir(tmp_path)
    lines = [
        " ".join([*line.split()[:-3], str(1000 * k), "host", "0"]) for k, line in enumerate(flaser_lines())
    ]
    assert main([f"bag={write(tmp_path / 'a.log', lines)}", "robot=turtlebot2", "tracking=none"]) == 2
    says(capsys.readouterr().err)


@pytest.mark.parametrize("odd", ["millimetres", "one stamp"])
def test_poses_and_stamps_that_no_robot_has_are_said(tmp_path, monkeypatch, says, odd):
    monkeypatch.chdir(tmp_path)
    poses = [Pose(0.1 * k, 0.0, 0.0) for k in range(40)]
    if odd == "millimetres":
        lines = flaser_lines([Pose(1000.0 * pose.x, 0.0, 0.0) for pose in poses])
    else:
        lines = [
            " ".join([*line.split()[:-3], "7", "host", "7"]) if line.startswith("FLASER") else line
            for line in flaser_lines(poses)
        ]
    with says.warns():
        main([f"bag={write(tmp_path / 'a.log', lines)}", "robot=turtlebot2", "tracking=none"])


def test_yaw_in_degrees_is_refused(tmp_path, says):
    in_degrees = [pose._replace(yaw=math.degrees(pose.yaw)) for pose in way()]
    with says.raises(InputError):
        CarmenLog(write(tmp_path / "degrees.log", flaser_lines(in_degrees)))
