"""The library composes `conf/` as Hydra does, and resolves what a file interpolates."""

import functools
from pathlib import Path

import pytest
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from omegaconf import OmegaConf

from lme.config.composer import SHIPPED, compose, find, resolved
from lme.errors import InputError
from lme.inputs.resources import overlaid
from runners.config import schema
from runners.config.composer import without_hydra
from tests.composing import composed

CONF = SHIPPED[0]
WHOLE = ("ablation", "system")  # groups whose files set keys of the whole config
GROUPS = sorted({path.parent.relative_to(CONF).as_posix() for path in CONF.rglob("*.yaml")} - {"."})
OPTIONS = [
    (group, path.stem)
    for group in GROUPS
    if not group.startswith("experiment") and group != "space"
    for path in sorted((CONF / group).glob("*.yaml"))
]
PARTS = [pair for pair in OPTIONS if pair[0] not in WHOLE]
SPACES = [path.stem for path in sorted((CONF / "space").glob("*.yaml"))]
GUIDES = [space for space in SPACES if find(f"guide/{space}")]  # whose space is that of the same name

pytestmark = pytest.mark.filterwarnings("ignore:.*is missing `_self_`")  # of an option as the primary config


@functools.cache
def hydra(name, *words):
    """Compose with Hydra: the plain config, not resolved."""
    schema.register()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return OmegaConf.to_container(hydra_compose(name, list(words)))


def whole(*words):
    return OmegaConf.to_container(without_hydra(composed("eval", *words)))


def part(group, option, **choices):
    return compose(find(f"{group}/{option}"), group, choices=choices)


@pytest.mark.parametrize(("group", "option"), PARTS)
def test_a_part_is_what_hydra_makes_of_its_file(group, option):
    ours = part(group, option)
    assert ours.settings == hydra(f"{group}/{option}")
    assert ours.choices == {}


@pytest.mark.parametrize(("group", "option"), [pair for pair in OPTIONS if pair not in PARTS])
def test_a_file_of_the_whole_config_sets_what_it_sets_in_hydra(group, option):
    ours = part(group, option)
    chosen = [f"{other}={choice}" for other, choice in ours.choices.items()]
    assert overlaid(whole(*chosen), ours.settings) == whole(f"{group}={option}")


@pytest.mark.parametrize("planner", ["simple", "dwa", "min_time"])
@pytest.mark.parametrize("guide", GUIDES)
def test_the_space_of_a_pair_is_what_hydra_makes_of_it(guide, planner):
    ours = part("space", guide, planner=planner)
    assert ours.values == hydra("train", f"guide={guide}", f"planner={planner}")["space"]


def test_a_space_without_a_guide_of_its_name():
    (space,) = set(SPACES) - set(GUIDES)
    assert part("space", space).settings == hydra(f"space/{space}")


def test_what_depends_on_a_choice_that_is_not_made_is_left_out():
    assert part("space", "target").values == {}


def test_the_choices_of_a_command_are_those_of_its_defaults_list():
    command = compose(find("eval"), "")
    assert (command.choices["map"], command.choices["system"]) == ("barn", None)
    assert command.values["runs"] == 3


@pytest.fixture
def own(tmp_path):
    """A config folder with three robots, each inheriting the one before."""
    (tmp_path / "robot").mkdir()
    for name, text in (
        ("_base", "name: base\nbody:\n  length: 1\n  width: 2\n"),
        ("long", "defaults: [_base, _self_]\nname: long\nbody:\n  length: 9\n"),
        ("wide", "defaults:\n  - long\nbody:\n  width: 8\n"),
        ("back", "defaults: [_self_, long]\nname: back\n"),
    ):
        (tmp_path / "robot" / f"{name}.yaml").write_text(text)
    return tmp_path


def test_a_file_holds_what_it_inherits(own):
    option = compose(own / "robot" / "wide.yaml", "robot", (own,))
    assert option.values == {"name": "long", "body": {"length": 9, "width": 8}}
    assert [file.stem for file in option.files] == ["_base", "long", "wide"]
    assert compose(own / "robot" / "back.yaml", "robot", (own,)).values["name"] == "long"


def test_a_users_file_for_a_shipped_class_may_leave_keys_out(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("# Dwa that keeps away\n_target_: lme.planners.dwa.Dwa\nmargin: 0.3\n")
    expected = {**compose(find("planner/dwa"), "planner").values, "margin": 0.3}
    assert compose(file, "planner").values == expected


@pytest.mark.parametrize(
    "text",
    [
        "defaults: [mine]\n",
        "defaults: [wid]\n",
        "defaults: long\n",
        "[1, 2]\n",
    ],
)
def test_a_file_that_cannot_be_composed_is_named(own, text, says):
    (own / "robot" / "mine.yaml").write_text(text)
    with says.raises(InputError):
        compose(own / "robot" / "mine.yaml", "robot", (own,))


def test_interpolations_follow_the_whole_config():
    values = {"speed": "${robot.v_max}", "lag": "${oc.select:sim.lag,0.5}", "range": "${given:reach,2.5}"}
    assert resolved("map", values, {"robot": {"v_max": 2.0}, "reach": None}, "mine") == {
        "speed": 2.0,
        "lag": 0.5,
        "range": 2.5,
    }
    assert resolved("map", {"path": Path("x")}, {}, "mine") == {"path": Path("x")}
    with pytest.raises(InputError, match=r"mine: .*robot"):
        resolved("map", values, {}, "mine")
