"""The tracker of people in small scenes: who moves is tracked, what stands is not, and the frames agree."""

import math

import numpy as np
import pytest

from lme.config.presets import load_robot
from lme.config.systems import load_system
from lme.errors import InputError
from lme.geometry.frames import compose, to_robot
from lme.perception.people.interface import PeopleConfig
from lme.perception.people.registration import flickered, moved_points, unpacked
from lme.perception.people.source import Nobody, People, TrackedPeople, people_source
from lme.perception.people.tracker import PeopleTracker
from lme.perception.raycast import add_noise, cast_shapes
from lme.types import LaserScan, Limits, Observation, Pose, Twist

BEAMS, FOV, RANGE, DT = 720, 4.71, 30.0, 0.1
MOUNT = Pose(0.1, 0.0, 0.0)
WALLS = np.array(
    [[-6.0, -6.0, 9.0, -6.0], [9.0, -6.0, 9.0, 6.0], [9.0, 6.0, -6.0, 6.0], [-6.0, 6.0, -6.0, -6.0]]
)
PILLARS = np.array([[4.0, -3.0, 0.3], [6.0, 3.5, 0.1], [2.0, 4.0, 0.2]])


def scan_at(pose, circles, noise=None):
    """What a robot at a pose sees of the room with these discs (C, 3)."""
    angles = (-FOV / 2, FOV / (BEAMS - 1), BEAMS)
    ranges = cast_shapes((*compose(pose, MOUNT),), angles, RANGE, np.vstack([PILLARS, circles]), WALLS)
    if noise is not None:
        add_noise(ranges, noise.standard_normal(BEAMS, dtype=np.float32), 0.02, RANGE)
    return LaserScan(ranges, angles[0], angles[1], 0.1, RANGE)


def follow(people, steps, poses=None, odometry=None, noise=None):
    """The tracks of every scan. people: function of time to discs (C, 3)."""
    tracker = PeopleTracker(PeopleConfig(), MOUNT)
    poses = poses or [Pose(0.0, 0.0, 0.0)] * steps
    scans = [scan_at(pose, people(k * DT), noise) for k, pose in enumerate(poses)]
    return [tracker.update(scan, pose, DT) for scan, pose in zip(scans, odometry or poses, strict=True)]


def nobody(time):
    return np.empty((0, 3))


def walker(time):
    return np.array([[5.0, -2.5 + 1.0 * time, 0.25]])


def driving(steps, speed=1.0, turn=0.3):
    """Poses of a robot on an arc."""
    poses = [Pose(-3.0, -1.0, 0.0)]
    for _ in range(steps - 1):
        poses.append(compose(poses[-1], Pose(speed * DT, 0.0, turn * DT)))
    return poses


def test_somebody_who_walks_across_is_tracked_within_half_a_second():
    found = follow(walker, 30)
    assert all(len(tracks.names) == 1 for tracks in found[5:])
    assert len({int(tracks.names[0]) for tracks in found[5:]}) == 1
    for k, tracks in enumerate(found[10:], 10):
        x, y, vx, vy = tracks.pedestrians[0]
        np.testing.assert_allclose((x, y), walker(k * DT)[0, :2], atol=0.05)
        np.testing.assert_allclose((vx, vy), (0.0, 1.0), atol=0.1)
    assert found[-1].radius[0] == pytest.approx(0.25, abs=0.03)
    assert found[-1].age[0] > 2.5
    eigenvalues = np.linalg.eigvalsh(found[-1].covariance[0])
    assert (eigenvalues > 0.0).all()


def test_places_and_velocities_are_in_the_frame_of_a_robot_that_drives_and_over_ground():
    poses = driving(25)
    for k, (pose, tracks) in enumerate(zip(poses, follow(walker, 25, poses), strict=True)):
        if k < 10:
            continue
        (found,) = tracks.pedestrians
        np.testing.assert_allclose(found[:2], to_robot(walker(k * DT)[0, :2], pose), atol=0.06)
        np.testing.assert_allclose(
            found[2:], to_robot(np.array([0.0, 1.0]), Pose(0.0, 0.0, pose.yaw)), atol=0.15
        )


def test_nobody_is_tracked_where_nothing_moves():
    assert not any(len(tracks.names) for tracks in follow(nobody, 40, driving(40)))


def test_a_wrong_yaw_of_the_odometry_moves_nobody():
    rng = np.random.default_rng(0)
    poses = driving(40)
    drift = np.cumsum(rng.normal(0.0, 0.03, 40))
    wrong = [pose._replace(yaw=pose.yaw + float(off)) for pose, off in zip(poses, drift, strict=True)]
    found = follow(nobody, 40, poses, wrong, rng)
    assert sum(len(tracks.names) for tracks in found) <= 2


def test_who_is_hidden_is_not_shown_and_keeps_their_name():
    def hides(time):
        return np.array([[6.5, -3.0 + 1.5 * time, 0.25], [3.0, 0.0, 0.4]])

    found = follow(hides, 40)
    names = [tracks.names.tolist() for tracks in found]
    hidden = [k for k in range(40) if abs(hides(k * DT)[0, 1]) < 0.5]
    assert not any(names[k] for k in hidden)
    before, after = names[hidden[0] - 4], names[hidden[-1] + 8]
    assert before == after != []


def test_the_same_scan_again_gives_the_same_tracks():
    tracker = PeopleTracker(PeopleConfig(), MOUNT)
    here = Pose(0.0, 0.0, 0.0)
    for k in range(15):
        found = tracker.update(scan_at(here, walker(k * DT)), here, DT)
    again = tracker.update(scan_at(here, walker(14 * DT)), here, 0.0)
    np.testing.assert_array_equal(again.pedestrians, found.pedestrians)


def test_a_reset_forgets_everybody():
    tracker = PeopleTracker(PeopleConfig(), MOUNT)
    here = Pose(0.0, 0.0, 0.0)
    for k in range(15):
        tracker.update(scan_at(here, walker(k * DT)), here, DT)
    tracker.reset()
    assert not len(tracker.update(scan_at(here, walker(1.5)), here, DT).names)


def test_a_scan_without_returns_is_read():
    tracker = PeopleTracker(PeopleConfig(), MOUNT)
    empty = scan_at(Pose(0.0, 0.0, 0.0), nobody(0.0))
    for bad in (np.inf, np.nan, 0.0, RANGE):
        scan = empty._replace(ranges=np.full(BEAMS, bad, np.float32))
        assert not len(tracker.update(scan, Pose(0.0, 0.0, 0.0), DT).names)


def observation(k, people):
    scan = scan_at(Pose(0.0, 0.0, 0.0), walker(k * DT))
    limits = Limits(1.0, 1.0, 1.0, 1.0)
    return Observation(scan, np.array([5.0, 0.0]), Twist(0.0, 0.0), limits, Pose(0.0, 0.0, 0.0), people)


@pytest.mark.parametrize("stamped", [True, False])
def test_tracked_people_replace_those_of_the_observation(stamped):
    robot = load_robot("jackal")
    source = TrackedPeople(robot)
    truth = np.array([[1.0, 2.0, 3.0, 4.0]])
    for k in range(15):
        seen = source.seen(observation(k, truth), 100.0 + k * DT if stamped else None)
    assert len(seen.pedestrians) == 1
    np.testing.assert_allclose(seen.pedestrians[0, 2:], (0.0, 1.0), atol=0.15)
    np.testing.assert_array_equal(source.tracks.pedestrians, seen.pedestrians)
    assert source.spent_us > 0.0


def test_the_sources_by_name(says):
    robot = load_robot("jackal")
    assert people_source(People.truth, robot) is None
    assert isinstance(people_source("tracked", robot), TrackedPeople)
    nobody_there = people_source("none", robot)
    assert isinstance(nobody_there, Nobody)
    assert not len(nobody_there.seen(observation(0, np.ones((2, 4))), None).pedestrians)
    with says.raises(InputError, match="people.*'seen'"):
        people_source("seen", robot)


def test_a_bad_parameter_is_named():
    with pytest.raises(InputError, match=r"people\.margin is -1"):
        PeopleConfig(margin=-1.0)


def test_the_noise_is_found_out():
    rng = np.random.default_rng(1)
    tracker = PeopleTracker(PeopleConfig(), MOUNT)
    for pose in driving(40):
        tracker.update(scan_at(pose, nobody(0.0), rng), pose, DT)
    assert 0.01 < tracker._noise < 0.04
    assert math.isfinite(tracker._noise)


def test_a_navigator_shows_its_guide_and_planner_the_tracked_people():
    navigator = load_system("lme_plus", load_robot("jackal"), people="none")
    navigator.reset(np.random.default_rng(0))
    navigator.act(observation(0, np.ones((1, 4))))
    assert not len(navigator.observation.pedestrians)
    with pytest.raises(InputError, match="people is 'all'"):
        load_system("lme_plus", load_robot("jackal"), people="all")


def legs(middle, time):
    """Two legs that swing, of somebody who walks along x."""
    swing = 0.15 * math.sin(2.0 * math.pi * time)
    return np.array([[middle[0] + swing, middle[1] + 0.1, 0.06], [middle[0] - swing, middle[1] - 0.1, 0.06]])


def test_somebody_on_two_legs_who_walks_away_is_one_track_with_their_velocity():
    found = follow(lambda time: legs((1.5 + 0.9 * time, 1.0), time), 40)
    assert all(len(tracks.names) == 1 for tracks in found[8:])
    for k, tracks in enumerate(found[12:], 12):
        np.testing.assert_allclose(tracks.pedestrians[0, :2], (1.5 + 0.9 * k * DT, 1.0), atol=0.2)
    speeds = np.array([tracks.pedestrians[0, 2:] for tracks in found[12:]])
    assert np.median(np.linalg.norm(speeds - (0.9, 0.0), axis=1)) < 0.2


def test_who_leaves_through_a_wall_does_not_become_the_wall():
    def passes(time):
        y = 5.6 if time < 2.5 else 50.0  # goes through a door in the wall
        return np.array([[-2.0 + 1.0 * time, y, 0.2]])

    found = follow(passes, 60)
    assert any(len(tracks.names) for tracks in found[10:25])
    assert not any(len(tracks.names) for tracks in found[32:])


def test_a_surface_that_returns_something_now_and_then_is_nobody():
    rng = np.random.default_rng(3)
    here, tracker = Pose(0.0, 0.0, 0.0), PeopleTracker(PeopleConfig(), MOUNT)
    shown = 0
    for k in range(80):
        scan = scan_at(here, nobody(0.0))
        flickers = (scan.ranges > 5.0) & (np.arange(BEAMS) > 400) & (np.arange(BEAMS) < 420)
        ranges = np.where(flickers & (rng.random() < 0.6), RANGE, scan.ranges).astype(np.float32)
        shown += len(tracker.update(scan._replace(ranges=ranges), here, DT).names) if k > 20 else 0
    assert shown == 0


def test_no_return_says_nothing_where_standing_things_are_often_missed():
    votes, standing = np.zeros((50, 2), np.int8), np.ones(50, bool)
    votes[:20, 1] = 1
    reliable, unreliable = (1000.0, 20.0), flickered(votes, standing, (0.0, 0.0))
    assert unreliable == (50.0, 20.0)
    seen_through, missed = np.array([[1, 0]], np.int8), np.array([[0, 3]], np.int8)
    loose = np.zeros(1, bool)
    assert moved_points(missed, loose, reliable)[0]
    assert not moved_points(missed, loose, unreliable)[0]
    assert moved_points(seen_through, loose, unreliable)[0]


def test_behind_a_beam_that_failed_nothing_is_free():
    ranges = np.array([2.0, np.nan, np.inf, 3.0], np.float32)
    directions = np.column_stack([np.ones(4), np.zeros(4)])
    _, hits, sure, free = unpacked(ranges, directions, (0.1, 10.0), 6.0, 0)
    np.testing.assert_array_equal(hits, [True, False, False, True])
    np.testing.assert_array_equal(sure, [2.0, 0.0, 0.0, 3.0])
    np.testing.assert_array_equal(free, [2.0, 0.0, 6.0, 3.0])


def test_people_all_around_do_not_move_the_robot():
    rng = np.random.default_rng(5)
    starts, ways = rng.uniform(-5.0, 5.0, (12, 2)), rng.uniform(-1.2, 1.2, (12, 2))
    found = follow(lambda time: np.column_stack([starts + time * ways, np.full(12, 0.3)]), 30, driving(30))
    errors = []
    for k, pose in enumerate(driving(30)):
        truth = to_robot(starts + k * DT * ways, pose)
        turned = to_robot(ways, Pose(0.0, 0.0, pose.yaw))
        for person in found[k].pedestrians:
            nearest = int(np.argmin(np.linalg.norm(truth - person[:2], axis=1)))
            errors.append(np.linalg.norm(person[2:] - turned[nearest]))
    assert len(errors) > 60
    assert np.quantile(errors, 0.8) < 0.3
