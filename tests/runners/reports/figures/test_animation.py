"""A moving picture of an episode: of the very same one, and only where something moves."""

from pathlib import Path

import pytest
from PIL import Image

from runners.cli.main import main
from runners.records.launch_record import read_launch
from runners.records.records import read_episodes, read_trajectories
from runners.reports.figures import animation
from runners.reports.figures.animation import animate

WORDS = ["robot=turtlebot2", "runs=1", "executor=serial", "tracking=none", "map.time_limit=4"]


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory):
    folder = tmp_path_factory.mktemp("moving")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = ["map=real1_dynamic", "map.worlds=[3]", "hydra.run.dir=out"]
        assert main(["eval", *words, *WORDS]) == 0
    return folder / "out"


def test_every_decision_and_the_end_are_shown(run_dir):
    with Image.open(run_dir / "episode.gif") as film:
        assert film.n_frames >= len(read_trajectories([run_dir]))  # the last one stays for a while
        assert film.info["duration"] == 200  # ms: 5 Hz


def test_a_moving_picture_is_of_the_recorded_episode(run_dir, tmp_path):
    outcome = animate(read_launch(run_dir).config, 3, tmp_path / "again.gif")
    assert read_episodes([run_dir])["outcome"].tolist() == [str(outcome)]


def test_a_long_episode_leaves_decisions_out_and_keeps_its_pace(run_dir, tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "MOST_FRAMES", 13)  # of 21
    animate(read_launch(run_dir).config, 3, tmp_path / "short.gif")
    with Image.open(tmp_path / "short.gif") as film:
        assert film.info["duration"] == 400  # ms: every second at 5 Hz


def test_where_nothing_moves_there_is_no_moving_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["eval", "map=real2", "map.worlds=[0]", "hydra.run.dir=out", *WORDS]) == 0
    assert not Path("out/episode.gif").exists()
