"""A recording holds what the policy saw, exactly: from the file alone it decides the same again."""

import json
import math
import re
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import to_robot, to_world
from lme.navigation.episode import run_episode
from lme.simulation.fast import FastSimulator
from lme.types import Twist
from runners.cli.main import main
from runners.config import build
from runners.config.schema import Record
from runners.evaluate import evaluate
from runners.records import launch_record, run_directories
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.workers.episodes import EpisodePayload, Recordings, episode_rng, initialise
from runners.workers.mcap_episodes import TOPICS, Recorder, half_angle, recording_path
from tests.builders import CLUTTER, navigator, stage, task
from tests.composing import jobs_of
from tests.places import ROOT
from tests.tolerances import KERNEL

pytest.importorskip("rosbags")

pytestmark = pytest.mark.usefixtures("undrawn")

WORLD, RUN, SEED = 3, 1, 7
SMALL = ("map=traps", f"map.worlds=[{WORLD}]", f"seed={SEED}", "record=mcap")
MOUNTED = ("robot.lidar.x=0.1", "robot.lidar.y=-0.05", "robot.lidar.yaw=0.3", "robot.lidar.noise_std=0.01")
LABELS = RunLabels(**dict.fromkeys((field.name for field in fields(RunLabels)), ""))
ROUNDED = "ignore:robot.collision_radius:UserWarning"  # go2's own
PAIRS = {
    "lme": ("robot=stage", *MOUNTED),
    "no maintenance": ("robot=go2", "ablation=no_maintenance"),  # an infinite parameter
    "reads odometry": ("robot=stage", "system=eband", *MOUNTED),
    "reads the true map": ("robot=jackal", "guide=global_path", "guide.global_map=known"),
}


class ListObserver:
    """Keeps what an observer is given."""

    def __init__(self):
        self.ticks, self.last = [], None

    def decided(self, *tick):
        self.ticks.append(tick)

    def ended(self, observation, state):
        self.last = observation, state


def composed(*words):
    with jobs_of("eval", *SMALL) as job:
        return job(*words).config


def record(folder, *words):
    """The path of a recording, the config, and what an observer of the same episode saw."""
    config = composed(*words)
    recordings = Recordings(folder, launch_record.identity(config))
    key = EpisodeKey(WORLD, RUN)
    initialise(EpisodePayload(config, LABELS, recordings))(key)
    observed = ListObserver()
    run_episode(
        build.map_set(config).task(WORLD),
        build.navigator(config),
        build.simulator(config),
        episode_rng(SEED, WORLD, RUN),
        observed,
    )
    return recording_path(folder, key), config, observed


def read(path):
    """(time [ns], message) of each topic."""
    from rosbags.highlevel import AnyReader

    found = {topic: [] for topic in TOPICS}
    with AnyReader([path]) as bag:
        assert {c.topic: c.msgtype for c in bag.connections} == TOPICS
        for connection, time, data in bag.messages():
            found[connection.topic].append((time, bag.deserialize(data, connection.msgtype)))
    return found


def snippet():
    """The code that the documentation gives."""
    text = (ROOT / "docs" / "howto" / "recording.md").read_text("utf-8")
    scope = {}
    exec(re.search(r"```python\n(.*?)```", text, re.S)[1], scope)
    return scope


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path, config, observed = record(tmp_path_factory.mktemp("recordings"), *PAIRS["lme"])
    return read(path), config, observed


def test_a_decision_is_one_message_of_each_kind_and_the_end_a_pose(recorded):
    topics, _, observed = recorded
    steps = len(observed.ticks)
    assert steps > 20
    counts = dict.fromkeys(("/goal", "/scan", "/subgoal", "/cmd_vel"), steps)
    counts |= {"/lme": 1, "/tf_static": 1, "/tf": steps + 1, "/odom": steps + 1}
    assert {topic: len(messages) for topic, messages in topics.items()} == counts


def test_scans_are_those_that_the_policy_saw_to_the_bit(recorded):
    topics, config, observed = recorded
    lidar = config.robot.lidar
    for (_, message), (seen, *_) in zip(topics["/scan"], observed.ticks, strict=True):
        assert message.ranges.dtype == np.float32
        np.testing.assert_array_equal(message.ranges.view(np.int32), seen.scan.ranges.view(np.int32))
        assert message.header.frame_id == "laser"
        assert message.range_max == lidar.range_max
        assert message.angle_max == pytest.approx(
            message.angle_min + (len(message.ranges) - 1) * message.angle_increment, abs=1e-4
        )


def test_twist_pose_goal_subgoal_and_command_are_exact(recorded):
    topics, _, observed = recorded
    each = zip(*(topics[name] for name in ("/odom", "/goal", "/subgoal", "/cmd_vel")), strict=False)
    for ((_, odom), (_, goal), (_, subgoal), (_, command)), (seen, guidance, told, _) in zip(
        each, observed.ticks, strict=True
    ):
        twist, pose = odom.twist.twist, odom.pose.pose
        assert (twist.linear.x, twist.angular.z) == seen.twist
        heading = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        assert (pose.position.x, pose.position.y, heading) == seen.odometry
        assert [goal.pose.position.x, goal.pose.position.y] == seen.target.tolist()
        assert [subgoal.point.x, subgoal.point.y] == guidance.subgoal.tolist()
        assert (command.linear.x, command.angular.z) == told


def test_frames_hang_together_and_the_goal_stands_still_in_odom(recorded):
    topics, config, observed = recorded
    lidar = config.robot.lidar
    mount = topics["/tf_static"][0][1].transforms[0]
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_link", "laser")
    assert (mount.transform.translation.x, mount.transform.translation.y) == (lidar.x, lidar.y)
    assert 2 * math.atan2(mount.transform.rotation.z, mount.transform.rotation.w) == lidar.yaw
    start, goal = build.map_set(config).task(WORLD).start, build.map_set(config).task(WORLD).goal
    poses = [seen.odometry for seen, *_ in observed.ticks]
    for (_, message), (_, moved), pose in zip(topics["/goal"], topics["/tf"], poses, strict=False):
        assert message.header.frame_id == moved.transforms[0].child_frame_id == "base_link"
        assert moved.transforms[0].header.frame_id == "odom"
        shift = moved.transforms[0].transform.translation
        assert (shift.x, shift.y) == pose[:2]
        target = np.array([message.pose.position.x, message.pose.position.y])
        np.testing.assert_allclose(to_world(target, pose), to_robot(goal, start), atol=KERNEL)


def test_the_last_pose_is_where_the_robot_came_to_rest(recorded):
    topics, _, observed = recorded
    observation, state = observed.last
    time, message = topics["/odom"][-1]
    assert (message.pose.pose.position.x, message.pose.pose.position.y) == observation.odometry[:2]
    assert time == round(state.time * 1e9) > topics["/scan"][-1][0]


def test_time_is_the_simulations_and_never_stands_still(recorded):
    topics, config, observed = recorded
    period = round(1e9 / config.robot.control_rate)
    times = [time for time, _ in topics["/scan"]]
    assert times == [period * number for number in range(len(times))]
    for topic, messages in topics.items():
        assert np.all(np.diff([time for time, _ in messages]) > 0), topic
        for time, message in messages:
            if hasattr(message, "header"):
                stamp = message.header.stamp
                assert stamp.sec * 1_000_000_000 + stamp.nanosec == time
    assert [time for time, _ in topics["/cmd_vel"]] == [round(s.time * 1e9) for *_, s in observed.ticks]


def test_the_file_says_what_was_driven(recorded):
    topics, config, observed = recorded
    about = json.loads(topics["/lme"][0][1].data)
    assert (about["seed"], about["world"], about["run"]) == (SEED, WORLD, RUN)
    assert about["scan"] == {k: v for k, v in observed.ticks[0][0].scan._asdict().items() if k != "ranges"}
    assert about["config"] == launch_record.identity(config)
    assert launch_record.recorded_config(about["config"]).robot == config.robot
    assert about["version"]


@pytest.mark.filterwarnings(ROUNDED)
@pytest.mark.parametrize("pair", PAIRS)
def test_from_the_file_alone_every_decision_is_the_same_again(tmp_path, pair):
    """By the code that the documentation gives."""
    path, _, observed = record(tmp_path, *PAIRS[pair])
    again = list(snippet()["decisions"](path))
    assert len(again) > 10
    assert [(s.tolist(), c) for s, c in again] == [(g.subgoal.tolist(), c) for _, g, c, _ in observed.ticks]


@given(st.floats(-math.pi, math.pi).filter(lambda yaw: yaw == 0.0 or abs(yaw) > 1e-300))
def test_the_quaternion_gives_the_heading_back_to_the_bit(yaw):
    z, w = half_angle(yaw)
    assert 2 * math.atan2(z, w) == yaw
    assert (z, w) == pytest.approx((math.sin(yaw / 2), math.cos(yaw / 2)), rel=KERNEL, abs=KERNEL)


def test_looking_on_changes_nothing():
    robot = stage()
    made = [
        run_episode(
            task(CLUTTER),
            navigator(robot),
            FastSimulator(load_settings("sim/fast"), robot),
            np.random.default_rng(4),
            observed,
        )
        for observed in (None, ListObserver())
    ]
    np.testing.assert_array_equal(made[0].trajectory, made[1].trajectory)


def test_chunks_are_compressed(tmp_path):
    path = tmp_path / "world-0-run-0.mcap"
    ranges_bytes = _driven(path)
    assert b"zstd" in path.read_bytes()
    assert path.stat().st_size < ranges_bytes / 2


def _driven(path):
    """Record a short drive of the stage robot; the number of bytes of its scans."""
    robot, simulator = stage(), FastSimulator(load_settings("sim/fast"), stage())
    observation = simulator.reset(task(CLUTTER), np.random.default_rng(0))
    driver = navigator(robot)
    driver.reset(np.random.default_rng(0))
    with Recorder(path, {}, robot) as recorder:
        for _ in range(60):
            command = driver.act(observation)
            recorder.decided(observation, driver.guidance, command, simulator.state)
            observation = simulator.step(Twist(0.0, 0.2))
        recorder.ended(observation, simulator.state)
    return 60 * observation.scan.ranges.nbytes


def test_a_file_takes_its_name_once_it_is_whole(tmp_path):
    path = tmp_path / "world-0-run-0.mcap"
    path.write_bytes(b"of an earlier run")
    (tmp_path / "world-0-run-0.partial").mkdir()
    (tmp_path / "world-0-run-0.partial" / "left").write_bytes(b"by a kill")
    with pytest.raises(ZeroDivisionError), Recorder(path, {}, stage()):
        raise ZeroDivisionError
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [
        (path.name, b"of an earlier run")
    ]
    _driven(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert read_lme(path)


def read_lme(path):
    return json.loads(read(path)["/lme"][0][1].data)


def test_where_no_file_can_be_written_it_says_so(tmp_path):
    (tmp_path / "recordings").write_bytes(b"")
    path = tmp_path / "recordings" / "world-0-run-0.mcap"
    with pytest.raises(InputError, match=f"^{path}: cannot be written .*hydra.run.dir=PATH$"):
        _driven(path)


def test_a_full_disk_is_one_line(tmp_path, monkeypatch, says):
    from rosbags.rosbag2.storage_mcap import McapWriter

    def full(self):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(McapWriter, "close_chunk", full)
    with says.raises(InputError):
        _driven(tmp_path / "world-0-run-0.mcap")
    assert not list(tmp_path.iterdir())


# The command


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def evaluated(*words):
    common = ("map=traps", "robot=stage", "executor=serial", "tracking=none", "hydra.run.dir=out")
    return main(["eval", *common, *words])


def files(folder="out/recordings"):
    return sorted(path.name for path in Path(folder).iterdir())


def test_every_episode_has_its_file_and_a_resumed_run_keeps_those_there_are(place, monkeypatch):
    words = ("map.worlds=[0,1]", "runs=2", "record=mcap")
    append = evaluate.RecordWriter.append

    def stop_after_three(self, result):
        append(self, result)
        if len(Path("out/parts/episodes.jsonl").read_bytes().splitlines()) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(evaluate.RecordWriter, "append", stop_after_three)
    assert evaluated(*words) != 0
    three = ["world-0-run-0.mcap", "world-0-run-1.mcap", "world-1-run-0.mcap"]
    assert files() == three
    before = {name: Path("out/recordings", name).stat().st_mtime_ns for name in three}
    monkeypatch.setattr(evaluate.RecordWriter, "append", append)
    assert main(["eval", "resume=out"]) == 0
    assert files() == [*three, "world-1-run-1.mcap"]
    assert {name: Path("out/recordings", name).stat().st_mtime_ns for name in three} == before
    numbers = [read_lme(Path("out/recordings", name)) for name in files()]
    assert [(n["world"], n["run"]) for n in numbers] == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_nothing_is_recorded_unless_asked_for(place):
    assert evaluated("map.worlds=[0]", "runs=1") == 0
    assert not Path("out/recordings").exists()


def test_without_rosbags_the_recorder_says_what_to_install_before_a_run(place, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rosbags", None)
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    assert evaluated("record=mcap") == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "pip install 'rosbags" in message
    assert not run_directories.holds_run(Path("out"))
    assert evaluated("map.worlds=[0]", "runs=1") == 0


@pytest.mark.parametrize("word", ["record=mcp", "record=null"])
def test_an_unknown_recording_format_is_refused(place, capsys, word, says):
    assert evaluated(word) == 2
    says(capsys.readouterr().err)
    assert list(Record) == ["none", "mcap"]
