"""Recorded episodes, taken over; and what is saved of a session."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from lme.errors import InputError
from lme.types import Outcome
from runners.cli import main
from runners.play.message_handler import MessageHandler
from runners.play.opening import is_log, open_episode, words_of, words_of_log
from runners.play.session import Session, Source
from runners.play.setups import setup_of
from runners.recordings.map_build import BuildConfig, build_map
from tests.made_logs import flaser_lines, write
from tests.runners.play.conftest import drive, ways

WORDS = [
    "robot=turtlebot2",
    "map=traps",
    "map.worlds=[1]",
    "system=dwa",
    "ablation=none",
    "map.time_limit=20",
]


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory):
    """A run with an episode that fails, with values that differ from those of the files."""
    place = tmp_path_factory.mktemp("runs") / "run"
    more = ["sim.scan_noise=0.01", "runs=2", "executor=serial", "tracking=none", f"hydra.run.dir={place}"]
    assert main.main(["eval", *WORDS, *more]) == 0
    return place


def test_an_episode_opens_where_it_went_wrong(run_dir):
    session = open_episode(run_dir, "1/1", None)
    (lane,) = session.lanes
    assert lane.outcome is Outcome.TIMEOUT
    targets = [np.hypot(*frame.moment.observation.target) for frame in lane.frames]
    assert session.shown == int(np.argmin(targets)) > 0
    assert open_episode(run_dir, None, 7).shown == 7
    assert session.script.setup.run == 1


def test_its_words_make_the_same_system_again(run_dir):
    session = open_episode(run_dir, "1/1", 0)
    again = drive(Session(setup_of(session.script.setup.source)))
    assert ways(again) == ways(session)


@pytest.mark.parametrize(
    ("word", "step"),
    [
        ("282/0", None),
        ("1/0", 9999),
        ("x", None),
    ],
)
def test_what_is_not_there_is_one_line(run_dir, word, step, says):
    with says.raises(InputError):
        open_episode(run_dir, word, step)


def test_a_record_of_another_version_is_refused(run_dir, tmp_path):
    other = shutil.copytree(run_dir, tmp_path / "other")
    launch = json.loads((other / "launch.json").read_text())
    launch["configs"][0]["seed"] = 5
    (other / "launch.json").write_text(json.dumps(launch))
    with pytest.raises(InputError, match="another path"):
        open_episode(other, "1/0", None)


def test_an_episode_whose_steps_were_deleted_opens(run_dir, tmp_path):
    other = shutil.copytree(run_dir, tmp_path / "other")
    (other / "trajectories.parquet").unlink()
    assert ways(open_episode(other, "1/1", 0)) == ways(open_episode(run_dir, "1/1", 0))
    records = pd.read_parquet(other / "episodes.parquet")
    records.assign(path_length_m=1.0).to_parquet(other / "episodes.parquet")
    with pytest.raises(InputError, match="another path"):
        open_episode(other, "1/1", 0)


def test_a_folder_that_does_not_exist_is_no_directory(tmp_path, says):
    with says.raises(InputError):
        open_episode(tmp_path / "gone", "3", None)


def test_words_that_name_an_episode_come_first():
    assert words_of(["RUN", "282/1", "--step", "5", "port=0"]) == (
        ["RUN", "282/1"],
        ["--step", "5", "port=0"],
    )
    assert words_of(["map=barn", "-cd", "x"]) == ([], ["map=barn", "-cd", "x"])


def test_a_recording_opens_and_keeps_its_config(run_dir, tmp_path):
    pytest.importorskip("rosbags")
    more = ["runs=1", "record=mcap", "executor=serial", "tracking=none", f"hydra.run.dir={tmp_path / 'run'}"]
    assert main.main(["eval", *WORDS, *more]) == 0
    session = open_episode(tmp_path / "run" / "recordings" / "world-1-run-0.mcap", None, 5)
    assert ways(session) == ways(open_episode(tmp_path / "run", "1/0", 5))
    error, *_ = MessageHandler(session, tmp_path).answer(
        '{"type": "words", "step": 0, "set": {"system": "lme"}}'
    )
    assert "own config alone" in error


def test_the_log_of_a_drive_opens_where_it_was_driven(tmp_path, run_dir):
    pytest.importorskip("rosbags")
    log = write(tmp_path / "room.log.gz", flaser_lines(rng=np.random.default_rng(0)))
    assert is_log(log)
    assert not is_log(run_dir)
    words = words_of_log(log, tmp_path)
    assert words[:2] == ("map=file", f"map.path={tmp_path / 'outputs/play/room_map.yaml'}")
    session = Session(setup_of(Source((*words, "robot=turtlebot2"), "play")))
    task = session.script.setup.task
    way = build_map([log], BuildConfig(), shown=False).way
    np.testing.assert_allclose(task.start[:2], way[0], atol=1e-3)
    farthest = np.hypot(*(way - way[0]).T).max()
    assert np.hypot(*np.subtract(task.goal, task.start[:2])) == pytest.approx(farthest, abs=2e-3)
    assert drive(session).lanes[0].outcome is Outcome.SUCCESS
