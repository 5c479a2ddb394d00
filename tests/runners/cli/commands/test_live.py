"""`lme live` on the command line: its help, what follows on a tab, and errors of one line."""

import pytest

from runners.cli.commands import completion
from runners.cli.main import main
from runners.ros import run


@pytest.fixture
def installed(monkeypatch):
    """Both versions of ROS, as far as the checks before the start go."""
    monkeypatch.setattr(run, "_INSTALLED", dict.fromkeys((1, 2), lambda: None))


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["robot=go2"],
        ["ros3"],
        ["simulator"],
        ["simulator", "--ros1", "--ros2"],
        ["ros1", "--ros2"],
        ["ros1", "map=env1"],
        ["simulator", "--ros2", "planner.v_gain=1"],
        ["simulator", "--ros2", "planner=dwa"],
        ["ros2", "topics.scan_type=Image"],
        ["ros2", "topics.twist=slope"],
        ["ros2", "topics.imu=''"],
        ["ros2", "topics.scann=x"],
        ["ros1", "topics.scan="],
        ["ros2", "topics.pose='a b'"],
        ["ros2", "live.stale=0"],
        ["ros2", "scan.mount=[1,2]"],
        ["simulator", "--ros1", "live.step=1"],
        ["simulator", "--ros1", "live.scan_rate=60"],
        ["simulator", "--ros1", "live.goal=radio"],
        ["simulator", "--ros2", "live.scan_frame=odom"],
        ["ros2", "ros=3"],
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line(installed, capsys, words, says):
    assert main(["live", *words]) == 2
    printed = capsys.readouterr().err
    says(printed)
    assert len(printed.splitlines()) == 1


@pytest.mark.parametrize(
    ("word", "packages"), [("ros1", "apt-get install"), ("ros2", "pip install ros-rclpy")]
)
def test_a_missing_ros_is_one_line_that_says_what_to_install(monkeypatch, capsys, tmp_path, word, packages):
    monkeypatch.setattr(f"runners.ros.{word}.find_spec", lambda name: None)
    monkeypatch.setattr("runners.ros.ros1.DEBIAN", tmp_path)
    assert main(["live", word]) == 2
    printed = capsys.readouterr().err
    assert packages in printed
    assert len(printed.splitlines()) == 1


def test_the_help_of_each_kind_shows_its_keys(capsys):
    assert main(["live", "simulator", "--help"]) == 0
    assert "live.speed=1.0" in capsys.readouterr().out
    assert main(["live", "ros1", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "live.stale=0.5" in shown
    assert "topics.scan=scan" not in shown  # --cfg job prints the keys of other groups


def test_a_tab_offers_the_kinds_and_the_keys_of_the_chosen_one():
    assert completion.candidates("lme live ros", ["live"])[:2] == ["ros1", "ros2"]
    assert "live.speed=" in completion.candidates("lme live simulator live.s", ["live"])
    assert "topics.scan=" in completion.candidates("lme live ros1 topics.sc", ["live"])


def test_the_config_is_printed_without_a_kind(capsys):
    assert main(["live", "--cfg", "job"]) == 0
    assert "cmd_vel" in capsys.readouterr().out
