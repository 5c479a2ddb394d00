"""`lme maps`: lines on the terminal, pictures in files."""

import logging
from pathlib import Path

import pytest
from PIL import Image

from lme.errors import InputError
from runners.cli.commands import maps
from runners.config import catalogue

SETS = catalogue.shipped().options("map")


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    """Pictures are written below the folder that one is in, and no log handler of another test speaks up."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(logging.root, "handlers", [])


def test_every_set_is_one_line(capsys, says):
    assert maps.main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[: len(SETS)]] == SETS
    assert all(len(line.split()) > 3 for line in lines[: len(SETS)])
    says(lines[-1])


def test_map_sets_of_ones_own_are_listed_and_shown(tmp_path, capsys):
    (tmp_path / "own" / "map").mkdir(parents=True)
    (tmp_path / "own" / "map" / "mine.yaml").write_text("# My map set\ndefaults: [traps]\nstarts: 2\n")
    maps.main(["--config-dir", "own"])
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[: len(SETS) + 1]] == sorted(
        [*SETS, "mine"]
    )
    for words in (["--config-dir", "own", "show", "mine"], ["show", "mine", "--config-dir", "own"]):
        maps.main(words)
        assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["world", "0", "1"]


def test_a_world_outside_the_subset_has_its_line_and_its_picture(capsys):
    maps.main(["show", "barn", "42"])
    out, err = capsys.readouterr()
    header, row = out.splitlines()
    assert header.split()[:3] == ["world", "optimal_time_s", "cylinders"]
    assert row.split()[:3] == ["42", "5.672", "202"]
    assert err.strip() == str(Path("outputs/maps/barn-42.png"))
    picture = Image.open("outputs/maps/barn-42.png")
    assert picture.height > picture.width > 500


def test_a_link_stays_one_and_its_file_becomes_the_picture(tmp_path):
    (tmp_path / "near.png").symlink_to("far.png")
    assert maps.main(["show", "traps", "0", "--output", str(tmp_path / "near.png")]) == 0
    assert (tmp_path / "near.png").is_symlink()
    assert (tmp_path / "far.png").read_bytes().startswith(b"\x89PNG")


def test_several_worlds_are_one_sheet_and_one_table(capsys):
    maps.main(["show", "traps", "0", "7", "kind=door", "--output", "sheets/two.pdf"])
    out, err = capsys.readouterr()
    assert [line.split()[0] for line in out.splitlines()[-2:]] == ["0", "7"]
    assert err.strip() == str(Path("sheets/two.pdf"))
    assert Path("sheets/two.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    "words",
    [
        ["map.subset=all", "--output", "a.png", "42", "7"],
        ["--output", "a.png", "42", "7", "subset=all"],
        ["42", "7", "42", "subset=all", "--output", "a.png"],
    ],
)
def test_worlds_settings_and_options_come_in_any_order(capsys, words):
    maps.main(["show", "barn", *words])
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[1:]] == ["42", "7"]
    assert Path("a.png").is_file()


def test_the_worlds_of_a_set_are_a_table_and_no_picture(capsys):
    maps.main(["show", "barn", "subset=official50"])
    out, err = capsys.readouterr()
    assert [int(line.split()[0]) for line in out.splitlines()[1:]] == list(range(0, 300, 6))
    assert err == ""
    assert not list(Path().iterdir())


def test_more_worlds_than_a_sheet_holds_are_still_a_table(capsys, says):
    numbers = [str(number) for number in range(61)]
    maps.main(["show", "dynabarn", *numbers])
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 62
    assert err == ""
    with says.raises(InputError):
        maps.main(["show", "dynabarn", *numbers, "--output", "all.png"])


@pytest.mark.parametrize(
    "words",
    [
        ["barn", "300"],
        ["barn", "-1"],
        ["barn", "3", "subset=fresh"],
        ["env1", "-1"],
        ["barn", "4a"],
        ["barn", "5-2"],
        ["bran"],
        ["barn", "subst=all"],
        ["barn", "count=3"],
        ["barn", "subset=["],
        ["file"],
        ["building"],
        ["barn", "--output", "a.png"],
        ["barn", "42", "--output", "a.gif"],
        ["barn", "42", "--output", "/dev/null/a.png"],
    ],
    ids=" ".join,
)
def test_mistakes_say_what_would_be_right(words, says):
    with says.raises(InputError):
        maps.main(["show", *words])


@pytest.mark.parametrize(
    "words",
    [
        ["show", "barn", "42", "--big"],
        ["show"],
        ["shwo"],
        ["import", "a", "b", "c"],
        ["--config-dir", "own", "import", "a", "b"],
    ],
)
def test_words_that_mean_nothing_are_refused(capsys, words):
    with pytest.raises(SystemExit) as stop:
        maps.main(words)
    assert stop.value.code == 2
    assert "error:" in capsys.readouterr().err
