"""`lme maps` and `lme figure maps` show the pair that `lme eval` drives, with the same words."""

import pytest
from PIL import Image, ImageDraw

from lme.errors import InputError
from lme.robots import Robot
from runners.config import build
from runners.config.catalogue import shipped
from runners.config.command_line import compose
from runners.config.map_sets import choose

TURNED = "image: map.png\nresolution: 0.05\norigin: [-1, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
BOT = "# A slow robot\ndefaults: [turtlebot2]\nname: bot\nv_max: 0.3\nfootprint: {radius: 0.3}\n"
MINE = (
    "# My map\ndefaults: [file]\npath: map.yaml\nmin_distance: 5.0\nspeed: ${robot.v_max}\ntime_limit: 90.0\n"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A turned ROS map, and options of one's own: the map `mine` and the robot `bot`."""
    monkeypatch.chdir(tmp_path)
    image = Image.new("L", (300, 200), 254)
    ImageDraw.Draw(image).rectangle([140, 60, 150, 199], fill=0)
    image.save("map.png")
    (tmp_path / "map.yaml").write_text(TURNED)
    for group, name, text in (("robot", "bot", BOT), ("map", "mine", MINE)):
        (tmp_path / "own" / group).mkdir(parents=True)
        (tmp_path / "own" / group / f"{name}.yaml").write_text(text)
    return tmp_path / "own"


@pytest.mark.parametrize(
    ("name", "settings", "robot"),
    [
        ("file", ["path=map.yaml"], []),
        ("file", ["path=map.yaml"], ["robot=jackal"]),
        ("file", ["path=map.yaml", "min_distance=1", "radius=0.2"], ["robot=stage"]),
        ("file", ["path=map.yaml", "sample_seed=3"], ["robot=bot"]),
        ("file", ["path=map.yaml"], ["robot=bot", "robot.v_max=0.1", "robot.footprint.radius=0.4"]),
        ("mine", [], ["robot=bot"]),
        ("mine", ["time_limit=null"], ["robot=go2"]),
        ("building", ["paths=[map.yaml]", "configurations=3"], ["robot=go2"]),
        ("env1", [], []),
        ("traps", ["kind=door"], ["robot=go2"]),
        ("real2", [], ["robot=turtlebot2"]),
        ("social", ["kind=corridor"], ["robot.v_max=0.8"]),
    ],
)
def test_it_is_the_pair_that_lme_eval_drives(folder, name, settings, robot):
    words = [f"map={name}", *(f"map.{setting}" for setting in settings), *robot, f"--config-dir={folder}"]
    (job,) = compose("eval", words)
    chosen, maps = (
        choose([name, "2", *settings, *robot], configs=shipped(folder)),
        build.map_set(job.config, [2]),
    )
    assert chosen.robot == job.config.robot
    one, other = chosen.maps.task(2), maps.task(2)
    assert one.start == other.start
    assert one.goal.tolist() == other.goal.tolist()
    assert (one.time_limit, one.optimal_time) == (other.time_limit, other.optimal_time)


def test_a_figure_gives_the_robot_unless_the_words_do():
    (job,) = compose("eval", ["robot=go2"])
    assert isinstance(job.config.robot, Robot)
    assert choose(["env1"], job.config.robot).robot.name == "go2"
    assert choose(["env1", "robot=stage"], job.config.robot).robot.name == "stage"
    assert choose(["env1"]).robot.name == "jackal"


@pytest.mark.parametrize(
    "word",
    [
        "robot=jackl",
        "robot.v_mx=1",
        "robot.v_max=-1",
        "robot.v_max=[",
    ],
)
def test_a_mistake_about_the_robot_is_one_line(word, says):
    with says.raises(InputError):
        choose(["env1", word])


def test_a_map_that_refers_to_nothing_is_one_line(folder):
    (folder / "map" / "mine.yaml").write_text(MINE.replace("robot.v_max", "robot.speed"))
    with pytest.raises(InputError, match=r"mine.yaml: .*robot.speed"):
        choose(["mine"], configs=shipped(folder))


def test_a_map_whose_interpolation_does_not_end_is_one_line(folder, says):
    (folder / "map" / "mine.yaml").write_text(MINE.replace("robot.v_max}", "robot.v_max"))
    with says.raises(InputError, match=r"speed.*\$\{robot\.v_max"):
        choose(["mine"], configs=shipped(folder))
