"""Our side of Robot SF's native_command: requests as its runner writes them, and the replies."""

import json
import subprocess
import sys

import numpy as np
import pytest

import lme
from tests.integration_scripts import load
from tests.places import ROOT

arm = load("lme_native_command")
WALL = [[[0.0, 6.0], [30.0, 6.0]], [[0.0, 14.0], [30.0, 14.0]]]
BOUNDS = [[[0.0, 0.0], [30.0, 0.0]], [[0.0, 0.0], [0.0, 20.0]]]


def request(position=(4.0, 10.0), heading=0.0, speed=(1.0, 0.0), goal=(24.0, 10.0), people=(), rows=4):
    """A request. people: (x, y) in the world and (vx, vy) in the robot's frame; empty rows follow them, as there."""
    places, moves = np.zeros((2, rows, 2))
    for i, (x, y, vx, vy) in enumerate(people):
        places[i], moves[i] = (x, y), (vx, vy)
    return {
        "robot": {
            "position": list(position),
            "heading": [heading],
            "speed": list(speed),
            "velocity_xy": [speed[0], 0.0],
            "angular_velocity": [speed[1]],
            "radius": [1.0],
        },
        "goal": {"current": list(goal), "next": list(goal)},
        "sim": {"timestep": [0.1]},
        "pedestrians": {
            "positions": places.tolist(),
            "velocities": moves.tolist(),
            "radius": [0.4],
            "count": [float(len(people))],
        },
        "static_geometry": {
            "schema_version": "native-command-static-geometry.v1",
            "scenario_id": "made_up",
            "obstacle_segments": WALL,
            "boundary_segments": BOUNDS,
            "sha256": "0" * 64,
        },
    }


def answers(requests, **options):
    lines = (json.dumps(each) for each in requests)
    return [json.loads(line) for line in arm.replies(lines, options.pop("system", "lme_plus"), **options)]


def test_a_request_is_read_in_full():
    scene = arm.scene_of(request(heading=np.pi / 2, people=[(5.0, 12.0, 1.0, 0.5)]))
    assert scene.pose == pytest.approx((4.0, 10.0, np.pi / 2))
    assert scene.twist == lme.Twist(1.0, 0.0)
    assert (scene.radius, scene.person, scene.dt) == (1.0, 0.4, 0.1)
    assert scene.walls.tolist() == [[0, 6, 30, 6], [0, 14, 30, 14], [0, 0, 30, 0], [0, 0, 0, 20]]
    assert scene.people == pytest.approx(np.array([[5.0, 12.0, -0.5, 1.0]]))  # over ground, in the world


def test_what_a_request_leaves_out_has_robot_sfs_defaults():
    flat = {
        "robot": {"position": [1, 2], "heading": [0.5], "speed": [0.7], "angular_velocity": None},
        "goal": {"current": [3, 4], "next": None},
        "pedestrians": {"positions": [], "velocities": [], "count": None},
    }
    scene = arm.scene_of(flat)
    assert scene.twist == lme.Twist(0.7, 0.0)
    assert (scene.radius, scene.person, scene.dt) == (1.0, 0.4, 0.1)
    assert scene.people.shape == (0, 4)
    assert scene.walls.shape == (0, 4)


def test_the_robot_sees_walls_and_people_in_its_own_frame():
    scene = arm.scene_of(request(heading=np.pi / 2, people=[(4.0, 13.0, -1.0, 0.0)]))
    seen = arm.observe(scene, arm.robot_of(scene))
    ahead = len(seen.scan.ranges) // 2
    assert seen.scan.ranges[ahead] == pytest.approx(2.6)  # the person, not the wall 4 m ahead
    assert seen.scan.ranges[0] == pytest.approx(4.0)  # behind: the wall
    assert seen.target == pytest.approx([0.0, -19.0])  # the robot's radius before the waypoint
    assert seen.pedestrians == pytest.approx(np.array([[3.0, 0.0, -1.0, 0.0]]))


def test_the_robot_aims_short_of_a_waypoint_and_never_beyond_itself():
    assert arm.short_of(np.array([0.0, 5.0]), 1.0) == pytest.approx([0.0, 4.0])
    assert arm.short_of(np.array([-1.5, 0.0]), 1.0) == pytest.approx([-0.75, 0.0])
    assert arm.short_of(np.zeros(2), 1.0) == pytest.approx([0.0, 0.0])


def test_only_people_in_sight_are_given():
    people = [
        (8.0, 10.0, -1.0, 0.0),
        (10.0, 10.0, -1.0, 0.0),
        (8.0, 15.0, 0.0, -1.0),
    ]  # seen, hidden, behind a wall
    scene = arm.scene_of(request(people=people))
    robot = arm.robot_of(scene)
    assert arm.observe(scene, robot).pedestrians[:, :2] == pytest.approx(np.array([[4.0, 0.0]]))


def test_the_reply_makes_the_command_the_next_velocity():
    """Robot SF takes `sent − v` as an acceleration, cuts it at its limits and multiplies it by dt."""
    now, command, dt = lme.Twist(1.0, -0.2), lme.Twist(1.05, -0.13), 0.1
    sent = arm.reply_of(command, now, dt)
    accelerations = np.clip(np.subtract(sent, now), -1.0, 1.0)
    assert np.add(now, accelerations * dt) == pytest.approx(command)


@pytest.mark.parametrize("people", ["truth", "tracked", "none"])
def test_replies_stay_within_the_accelerations_of_robot_sf(people):
    walking = [(9.0 - 0.1 * k, 10.0, -1.0, 0.0) for k in range(8)]
    asked = [request(people=[person]) for person in walking]
    for answer in answers(asked, people=people):
        assert abs(answer["linear_velocity"] - 1.0) <= 1.0 + 1e-9
        assert abs(answer["angular_velocity"]) <= 1.0 + 1e-9


def test_it_speeds_up_where_the_way_is_free_and_brakes_before_somebody():
    (free,) = answers([request()], people="truth")
    (blocked,) = answers([request(people=[(5.7, 10.0, 0.0, 0.0)])], people="none")  # 0.3 m ahead
    assert free["linear_velocity"] == pytest.approx(2.0)  # 1 m/s and an acceleration of 1 m/s²
    assert blocked["linear_velocity"] < 1.0


def test_as_is_sends_the_velocity_itself():
    (answer,) = answers([request()], people="tracked", as_is=True)
    assert answer["linear_velocity"] == pytest.approx(1.1)


def test_the_process_answers_line_by_line():
    script = ROOT / "integrations" / "robot_sf" / "lme_native_command.py"
    with subprocess.Popen(
        [sys.executable, script, "--people", "truth"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    ) as process:
        for _ in range(2):
            process.stdin.write(json.dumps(request()) + "\n")
            process.stdin.flush()
            answer = json.loads(process.stdout.readline())
            assert set(answer) == {"linear_velocity", "angular_velocity"}
        process.stdin.close()
        assert process.wait(timeout=60) == 0
