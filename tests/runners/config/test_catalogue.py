"""The options of config folders, their titles and the comments of their keys."""

import pytest

from runners.config.catalogue import Catalogue, Key


@pytest.fixture
def own(tmp_path):
    """A catalogue of one folder with three robots, each inheriting the one before."""
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "_base.yaml").write_text(
        "# Base\nname: base  # its name\nbody:\n  length: 1  # [m]\n  width: 2\n"
    )
    (folder / "long.yaml").write_text("# Long\ndefaults: [_base, _self_]\nname: long\nbody:\n  length: 9\n")
    (folder / "wide.yaml").write_text("# Wide\ndefaults:\n  - long\nbody:\n  width: 8  # wide\n")
    return Catalogue((tmp_path,))


def test_a_key_keeps_the_inherited_comment_unless_it_has_its_own(own):
    assert own.keys("robot/wide") == [
        Key("name", "long", "its name"),
        Key("body.length", "9", "[m]"),
        Key("body.width", "8", "wide"),
    ]


def test_a_base_file_is_not_an_option(own):
    assert own.options("robot") == ["long", "wide"]
    assert own.title("robot/long") == "Long"


def test_an_absent_file_is_not_found(own):
    with pytest.raises(FileNotFoundError):
        own.option("robot/narrow")
    with pytest.raises(FileNotFoundError):
        own.option("x" * 5000)
    assert own.options("x" * 5000) == []
