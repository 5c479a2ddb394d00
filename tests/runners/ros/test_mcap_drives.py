"""A recording of a live drive: `lme replay` and `lme explain` make the same decisions on it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rosbags")

import pandas as pd

from lme.config.presets import load_map_set
from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.live.step import LiveState, LiveStep
from lme.mapping.occupancy import FREE, OCCUPIED
from lme.worlds.check import point_clearance
from runners.cli.main import main
from runners.config import build
from runners.recordings import figures
from runners.recordings.bags import Bag
from runners.recordings.map_build import BuildConfig, build_map
from runners.recordings.own_recordings import retrace
from runners.ros.mcap_drives import LIVE_TOPICS, LiveRecorder
from runners.workers.episodes import episode_rng
from tests.composing import jobs_of
from tests.live_loop import drive_live
from tests.made_bags import drive

pytestmark = pytest.mark.usefixtures("undrawn")

WORLD = 210
PAIRS = {
    "lme": ("robot=jackal",),
    "lme and dwa": ("robot=jackal", "planner=dwa"),
    "capped": ("robot=jackal", "cap.v_max=1.2", "cap.omega_max=2"),
    "a path": ("robot=jackal", "guide=global_path", "planner=eband"),
}


class Drive:
    """A recorded drive of a simulated robot through a BARN world."""

    def __init__(self, folder, *words, disturb=None, expects=lambda robot: robot):
        """expects: the robot that the driver's config describes, if its lidar is another one."""
        with jobs_of("eval", "map=barn", "sim=fast", f"map.worlds=[{WORLD}]", "seed=3") as job:
            config = job(*words).config
        self.folder, self.recorder = folder, None

        def listen(driver, step):
            self.recorder = self.recorder or LiveRecorder(folder, config, driver)
            self.recorder.take(step if disturb is None else disturb(step))

        robot, task = config.robot, load_map_set("barn", {"worlds": [WORLD]}).task(WORLD)
        self.driver, self.steps, self.outcome, _ = drive_live(
            task,
            lambda robot: build.navigator(config, robot),
            robot,
            build.simulator(config),
            episode_rng(3, 1, 0),
            listen,
            expects(robot),
            seed=3,
        )
        self.path = folder / "goal-1.mcap"

    def arrive(self):
        """The last tick, at the goal."""
        end = self.steps[-1]
        step = LiveStep(end.stamp + 10**8, LiveState.ARRIVED, "arrived", goal=1, motion=end.motion)
        self.recorder.take(step)
        return self


@pytest.fixture(scope="module", params=PAIRS.values(), ids=PAIRS)
def driven(request, tmp_path_factory):
    return Drive(tmp_path_factory.mktemp("live"), *request.param).arrive()


@pytest.fixture(scope="module")
def by_lme(tmp_path_factory):
    return Drive(tmp_path_factory.mktemp("live"), *PAIRS["lme"]).arrive()


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(figures, "write", lambda *_: [])
    return tmp_path


def test_a_drive_that_its_simulator_ends_says_what_was_left_to_the_goal(tmp_path, says):
    """At the end of an episode no scan comes any more, so that the driver's last word is that it stands for safety."""
    drive = Drive(tmp_path, *PAIRS["lme"])
    assert drive.outcome == "success"
    tenth = 10**8  # [ns]
    with drive.recorder:
        for number in range(1, 9):
            drive.recorder.take(drive.driver.tick(drive.steps[-1].stamp + number * tenth))
    says(messages(drive.path)["/state"][-1].data)
    trace = retrace(drive.path)
    left = float(np.hypot(*trace.end.observation.target))
    assert trace.episode.outcome == f"{left:.2f} m from the goal"
    assert 1.0 < left < 1.3  # the last step leads into the tolerance of 1 m, unseen


def messages(path):
    """The messages of every topic in order."""
    found = {topic: [] for topic in LIVE_TOPICS}
    with Bag(path) as bag:
        for message in bag.messages(LIVE_TOPICS):
            found[message.topic].append(message.content)
    return found


def test_replay_makes_the_very_same_decisions(driven, place, capsys):
    assert main(["replay", str(driven.path), "tracking=none", "hydra.run.dir=out"]) == 0
    table = pd.read_parquet(place / "out/replay.parquet")
    assert len(table) == len(driven.steps)
    np.testing.assert_array_equal(
        table[["command_v_mps", "command_omega_radps"]], [step.wanted for step in driven.steps]
    )
    np.testing.assert_array_equal(
        table[["subgoal_x_m", "subgoal_y_m"]], [step.guidance.subgoal for step in driven.steps]
    )
    assert json.loads((place / "out/agreement.json").read_text())["same_command"] == 1.0
    assert "goal 1, seed 3 of lme live, as it was driven; 100 %" in capsys.readouterr().out


def test_explain_shows_the_drive(driven, place, capsys):
    assert main(["explain", str(driven.path), "--output", "why.html"]) == 0
    assert "live, goal 1" in (place / "why.html").read_text()
    trace = retrace(driven.path)
    assert len(trace.steps) == len(driven.steps)
    assert trace.episode.outcome == "arrived"
    np.testing.assert_allclose(
        [step.pose for step in trace.steps], [step.observation.odometry for step in driven.steps]
    )
    assert np.hypot(*trace.end.observation.target) < 2.0
    assert (trace.episode.trajectory[:-1, 9] > 0.0).all()
    assert np.isnan(trace.episode.trajectory[-1, 9])  # nothing is seen at the end


def test_explain_prints_the_recorded_reasons(by_lme, place, capsys):
    assert main(["explain", str(by_lme.path), "--text"]) == 0
    told = capsys.readouterr().out
    assert re.match(rf"Live, goal 1, run 0: arrived after [\d.]+ s, {len(by_lme.steps)} decisions", told)
    why = [message.data for message in messages(by_lme.path)["/why"]]
    assert len(why) == len(by_lme.steps)
    assert why[0].startswith("first subgoal: ")
    assert why[0] in told
    switched = [sentence for sentence in why if sentence.startswith("switched")]
    assert len(switched) == sum(step.guidance.switched for step in by_lme.steps[1:]) > 0


def test_explain_opens_a_recording_of_eval(place, capsys):
    words = ("map=traps", "map.worlds=[1]", "runs=1", "robot=stage", "record=mcap", "tracking=none")
    assert main(["eval", *words, "executor=serial", "hydra.run.dir=run"]) == 0
    path = place / "run/recordings/world-1-run-0.mcap"
    assert main(["explain", "run", "1", "--text"]) == 0
    told = capsys.readouterr().out
    assert main(["explain", str(path), "--text"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == told[told.index("World 1") :].splitlines()[1:]
    assert main(["explain", str(path)]) == 0
    assert path.with_suffix(".html").is_file()


def test_the_recording_holds_commands_states_and_odometry(by_lme):
    found = messages(by_lme.path)
    sent = [(message.linear.x, message.angular.z) for message in found["/cmd_vel"]]
    before = (0.0, 0.0)  # what the robot followed at the first decision
    assert sent == [before, *(tuple(step.command) for step in by_lme.steps), (0.0, 0.0)]
    assert [message.data for message in found["/state"]] == ["driving", "arrived"]
    assert len(found["/odom"]) == len(found["/scan"]) + 1 == len(by_lme.steps) + 1


def test_stops_on_the_way_and_jumps_of_the_clock_stay_readable(tmp_path, place, says):
    """Stops hold no decision; after a jump back, stamps continue from the last."""
    count = iter(range(10_000))

    def disturb(step):
        number = next(count)
        back = 10**10 if number > 20 else 0
        step = step._replace(stamp=step.stamp - back)
        if number != 20:
            return step
        return LiveStep(
            step.stamp, LiveState.STOPPED, "the scan is older than 0.5 s", goal=1, motion=step.motion
        )

    drive = Drive(tmp_path, *PAIRS["lme"], disturb=disturb)
    drive.recorder.__exit__(None, None, None)
    found = messages(drive.path)
    stamps = [10**9 * m.header.stamp.sec + m.header.stamp.nanosec for m in found["/odom"]]
    assert (np.diff(stamps) > 0).all()
    assert len(found["/scan"]) == len(drive.steps) - 1
    assert [m.data for m in found["/state"]] == [
        "driving",
        "stopped: the scan is older than 0.5 s",
        "driving",
    ]
    with says.raises(InputError):
        retrace(drive.path)  # the decision of the step that was dropped is missing


def test_the_lidar_that_was_there_is_the_one_that_is_recorded(tmp_path):
    """Not the one of the config."""

    def other(robot):
        return replace(robot, lidar=replace(robot.lidar, num_beams=90, fov=1.0, x=0.0))

    drive = Drive(tmp_path, *PAIRS["lme"], expects=other).arrive()
    trace = retrace(drive.path)
    assert trace.robot.lidar == drive.driver.robot.lidar
    assert trace.robot.lidar.num_beams == 720
    assert len(trace.steps) == len(drive.steps)


def test_every_goal_has_a_file(tmp_path):
    drive = Drive(tmp_path, *PAIRS["lme"])
    for step in drive.steps[:5]:
        drive.recorder.take(step._replace(goal=2, stamp=step.stamp + 10**12))
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["goal-1.mcap", "goal-2.partial"]
    drive.recorder.take(LiveStep(10**12, LiveState.CANCELLED, "cancelled", goal=2))
    drive.recorder.take(LiveStep(10**12 + 1, LiveState.CANCELLED, "cancelled", goal=2))
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["goal-1.mcap", "goal-2.mcap"]
    assert len(messages(tmp_path / "goal-2.mcap")["/scan"]) == 5


def test_a_step_that_is_given_again_is_written_once(tmp_path):
    drive = Drive(tmp_path, *PAIRS["lme"])
    drive.recorder.take(drive.steps[-1])
    drive.arrive()
    assert len(messages(drive.path)["/scan"]) == len(drive.steps)


def test_a_recording_of_somebody_else(tmp_path, capsys, says):
    path = drive(steps=3).write(tmp_path)
    assert main(["explain", str(path)]) == 2
    said = capsys.readouterr().err
    says(said)
    assert said.count("\n") == 1
    assert main(["explain", str(path), "3"]) == 2
    says(capsys.readouterr().err)
    assert main(["explain", "absent.mcap"]) == 2
    says(capsys.readouterr().err)


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "live").write_bytes(b"")
    with pytest.raises(InputError, match=r"cannot be written.*hydra.run.dir=PATH"):
        Drive(tmp_path / "live", *PAIRS["lme"])


def test_a_map_is_built_from_a_recording(by_lme):
    """Its obstacles are those of the world that the robot drove through; odometry begins at the start."""
    built = build_map([by_lme.path], BuildConfig(radius=0.25), shown=False)
    rows, columns = np.indices(built.map.cells.shape)
    points = (np.stack((columns, rows), axis=-1) + 0.5) * built.map.resolution + built.map.origin
    task = load_map_set("barn", {"worlds": [WORLD]}).task(WORLD)
    free, occupied = (to_world(points[built.map.cells == value], task.start) for value in (FREE, OCCUPIED))
    assert all(point_clearance(task.world, point) > -0.1 for point in free[::20])
    assert len(occupied) > 200
    assert max(abs(point_clearance(task.world, point)) for point in occupied) < 0.1
