"""The plain-YAML reader of config folders: what a file inherits through its defaults list."""

import pytest
from omegaconf import OmegaConf

from runners.config import schema
from runners.config.catalogue import Catalogue, Key, shipped
from runners.config.composer import Composer

CATALOGUE = shipped()
INHERITING = [
    f"{group}/{option}"
    for group in ("map", "robot", "planner")
    for option in CATALOGUE.options(group)
    if len(CATALOGUE.files(f"{group}/{option}")) > 1
]


@pytest.fixture(scope="module")
def composer():
    schema.register()
    with Composer("eval") as composer:
        yield composer


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


def test_a_file_holds_what_it_inherits(own):
    assert own.values("robot/wide") == {"name": "long", "body": {"length": 9, "width": 8}}
    assert [file.stem for file in own.files("robot/wide")] == ["_base", "long", "wide"]


def test_a_key_keeps_the_inherited_comment_unless_it_has_its_own(own):
    assert own.keys("robot/wide") == [
        Key("name", "long", "its name"),
        Key("body.length", "9", "[m]"),
        Key("body.width", "8", "wide"),
    ]


def test_defaults_before_self_are_overridden_and_those_after_override(own, tmp_path):
    (tmp_path / "robot" / "back.yaml").write_text("# Back\ndefaults: [_self_, long]\nname: back\n")
    assert own.values("robot/back")["name"] == "long"


def test_a_base_file_is_not_an_option(own):
    assert own.options("robot") == ["long", "wide"]
    assert own.title("robot/long") == "Long"


def test_an_absent_file_is_not_found(own):
    with pytest.raises(FileNotFoundError):
        own.files("robot/narrow")
    with pytest.raises(FileNotFoundError):
        own.files("x" * 5000)
    assert own.options("x" * 5000) == []


@pytest.mark.parametrize("name", INHERITING)
def test_hydra_composes_the_same(composer, name):
    group, _, option = name.partition("/")
    composed = composer.compose([f"{group}={option}"])[group]
    assert OmegaConf.to_container(composed) == CATALOGUE.values(name)


def test_drawn_scenes_and_tuned_planners_inherit():
    assert {"map/real1", "map/go2_b", "map/file", "robot/jackal_wheels", "planner/dwa_tuned"} <= set(
        INHERITING
    )
