"""`lme maps build` and `lme maps buildings` on the command line."""

import re

import pytest

from runners.cli.main import main
from tests.made_logs import flaser_lines, write


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "office.log.gz", flaser_lines())
    return tmp_path


def test_a_map_is_built_where_the_other_pictures_are(folder, capsys):
    assert main(["maps", "build", "office.log.gz"]) == 0
    out = capsys.readouterr().out
    assert (folder / "outputs/maps/office.yaml").is_file()
    assert "scans /scan, poses /pose (odom to base_link)" in out
    assert "picture  outputs/maps/office_way.png" in out
    assert re.search(
        r"^scans    \d+ of \d+ beams without return, 0 scans without a point$", out, re.MULTILINE
    )
    assert "lme eval map=building 'map.paths=[outputs/maps/office.yaml]'" in out
    assert main(["maps", "build", "office.log.gz"]) == 2
    assert "office.yaml exists; add --overwrite" in capsys.readouterr().err
    assert main(["maps", "build", "office.log.gz", "--overwrite"]) == 0


def test_the_printed_command_drives_in_the_map(folder, capsys):
    assert main(["maps", "build", "office.log.gz", "--output", "maps/office.yaml"]) == 0
    words = ["eval", "map=building", "map.paths=[maps/office.yaml]", "robot=turtlebot2"]
    fast = ["map.worlds=[0]", "map.min_distance=2.0", "runs=1", "tracking=none", "executor=serial"]
    assert main([*words, *fast]) == 0
    assert (
        main(["maps", "show", "building", "0", "paths=[maps/office.yaml]", "min_distance=2", "radius=0.2"])
        == 0
    )
    assert "passage_m" in capsys.readouterr().out


def test_options_and_settings_in_any_order(folder, capsys):
    words = [
        "--radius",
        "0.2",
        "office.log.gz",
        "start=2",
        "--output",
        "a.yaml",
        "end=20.5",
        "--resolution",
        "0.1",
    ]
    assert main(["maps", "build", *words]) == 0
    assert "from 19 scans" in capsys.readouterr().out
    assert "resolution: 0.1" in (folder / "a.yaml").read_text()


@pytest.mark.parametrize(
    "words",
    [
        ["none.log"],
        ["none.bag"],
        ["start=2"],
        ["office.log.gz", "topic.scan=/a"],
        ["office.log.gz", "topics.scan=/a"],
        ["office.log.gz", "--resolution", "0"],
        ["office.log.gz", "--no-returns", "maybe"],
        ["office.log.gz", "--output", "a.png"],
        ["office.log.gz", "--output", "/dev/null/a.yaml"],
        ["office.log.gz", "scan.mount=[1,2"],
    ],
    ids=" ".join,
)
def test_mistakes_are_one_line(capsys, words, says):
    assert main(["maps", "build", *words]) == 2
    err = capsys.readouterr().err.strip().splitlines()
    says(err[-1])
    assert err[-1].startswith("lme maps: ")


def test_the_buildings_need_their_logs(capsys, says):
    assert main(["maps", "buildings", "."]) == 2
    says(capsys.readouterr().err)
