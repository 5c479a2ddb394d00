"""A made drive among labelled people: what is read of it, who is scored, and the row of the report."""

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from rosbags.typesys import get_types_from_msg

from benchmarks.people.__main__ import report
from benchmarks.people.moving import labels_of, read_drive, tracked_in_sector
from lme.errors import InputError
from lme.geometry.frames import compose, to_robot
from lme.perception.raycast import cast_shapes
from lme.types import Pose
from tests.made_bags import BEGAN, EDGES, SECOND, TF, BagMaker

PERSON = "leg_tracker/msg/Person"
MOUNT = Pose(0.3, 0.1, 0.5)
STEPS, PERIOD, BEAMS = 40, 0.1, 720
WALKS, STANDS, BESIDE = 7, 8, 9  # the last one walks outside the sector
VELOCITY = np.array([0.2, -0.9])
ODOM = "nav_msgs/msg/Odometry"


def base(time):
    """Where the robot is: it drives a left curve at 0.5 m/s."""
    return Pose(0.5 * time, 0.02 * time**2, 0.1 * time)


def people(time):
    """Everybody's name and place, over ground."""
    return {
        WALKS: np.array([4.0, 2.4]) + VELOCITY * time,
        STANDS: np.array([5.0, 0.0]),
        BESIDE: np.array([-1.0, 2.0]) + 0.5 * time,
    }


def made(labelled=True):
    """A recording of the drive. A label comes half a period after its scan, as its authors write it."""
    bag = BagMaker(".bag")
    bag.store.register(get_types_from_msg("geometry_msgs/Pose pose\nuint32 id", PERSON))
    bag.add("/tf", TF, BEGAN, bag.transform(BEGAN, "base_link", "laser", MOUNT))
    for k in range(STEPS):
        time, stamp = k * PERIOD, BEGAN + round(k * PERIOD * SECOND)
        scanner = compose(base(time), MOUNT)
        bag.add("/odom", ODOM, stamp, bag.odometry(stamp, base(time), 0.5, 0.1))
        circles = np.array([[*place, 0.25] for place in people(time).values()])
        beams = -math.pi, math.tau / BEAMS, BEAMS
        scan = bag.scan(stamp, cast_shapes(scanner, beams, 12.0, circles, EDGES), *beams[:2])
        bag.add("/scan", "sensor_msgs/msg/LaserScan", stamp, scan)
        for name, place in people(time).items() if labelled else ():
            pose = bag.pose(Pose(*to_robot(place, scanner), 0.0))
            bag.add("/ground_truth_people_tracks", PERSON, stamp + SECOND // 20, bag.make(PERSON, pose, name))
    return bag


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return made().write(tmp_path_factory.mktemp("moving"))


def test_a_drive_has_the_scanners_poses_and_every_label_at_its_scan(path):
    drive = read_drive(path)
    expected = [compose(base(k * PERIOD), MOUNT) for k in range(STEPS)]
    np.testing.assert_allclose(drive.poses, expected, atol=1e-6)
    assert drive.recording.ranges.shape == (STEPS, BEAMS)
    np.testing.assert_array_equal(drive.labels[:, 0], np.repeat(np.arange(STEPS), 3))
    own = drive.labels[drive.labels[:, 1] == WALKS, 2:]
    places = [to_robot(people(k * PERIOD)[WALKS], expected[k]) for k in range(STEPS)]
    np.testing.assert_allclose(own, places, atol=1e-6)


def test_who_moves_over_ground_and_is_in_the_sector_is_scored(path):
    drive = read_drive(path)
    found = labels_of(drive)
    bearings = np.degrees(np.arctan2(found.place[:, 1], found.place[:, 0]))
    scored = (found.person == WALKS) & (bearings >= -80.0) & (bearings <= 12.0)
    assert 0 < scored.sum() < STEPS
    np.testing.assert_array_equal(found.walking, scored)
    for scan, velocity in zip(found.scan[scored], found.velocity[scored], strict=True):
        turn = Pose(0.0, 0.0, drive.poses[scan].yaw)
        np.testing.assert_allclose(velocity, to_robot(VELOCITY, turn), atol=1e-5)
    assert np.abs(found.velocity[found.person == STANDS]).max() < 1e-5  # although the scanner passes them


def test_who_is_labelled_once_is_not_scored(path):
    drive = read_drive(path)
    found = labels_of(drive._replace(labels=drive.labels[drive.labels[:, 0] == 20]))
    assert len(found.scan) == 3
    assert not found.walking.any()


def test_tracks_are_those_of_the_sector(path):
    drive = read_drive(path)
    places = np.vstack([tracks.pedestrians[:, :2] for tracks, _ in tracked_in_sector(drive)])
    bearings = np.degrees(np.arctan2(places[:, 1], places[:, 0]))
    assert len(places)
    assert bearings.min() >= -80.0
    assert bearings.max() <= 12.0


def test_the_report_says_how_many_labels_it_scores(path):
    *_, row = report(Path("absent"), "0", ["moving"], path)
    name, _, recall, precision, *_ = [cell.strip() for cell in row.strip("|").split("|")]
    assert name == f"real, robot drives, {labels_of(read_drive(path)).walking.sum()} labels"
    assert float(recall) > 0.8
    assert float(precision) > 0.8


def test_an_absent_recording_is_one_line(tmp_path):
    *_, row = report(tmp_path, "0", ["moving"], tmp_path / "drive.bag")
    assert row == f"| moving: {tmp_path / 'drive.bag'} is absent |"


def test_a_recording_without_labels_is_refused(tmp_path):
    with pytest.raises(InputError, match="no labels"):
        read_drive(made(labelled=False).write(tmp_path))
