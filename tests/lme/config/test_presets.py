"""Robots and parameters by name, without Hydra."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import yaml
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from lme.config.presets import load_map_set, load_parameters, load_robot, load_settings, load_simulator
from lme.errors import InputError
from lme.guides.lme.score import CRITERIA
from lme.guides.lme.weight_files import find_weights
from lme.robots import Robot
from runners.config.instantiate import build, configured, fill_dataclass
from tests.places import ROOT

ROBOTS = sorted((ROOT / "conf" / "robot").glob("[!_]*.yaml"))
STAGE = (ROOT / "conf" / "robot" / "stage.yaml").read_text(encoding="utf-8")


@pytest.mark.filterwarnings("ignore:.*collision_radius")
@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_a_robot_is_what_hydra_makes_of_its_file(path):
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        given = OmegaConf.to_container(compose(f"robot/{path.stem}").robot)
    expected = fill_dataclass(Robot, given, "robot")
    assert load_robot(path.stem) == load_robot(path) == load_robot(str(path)) == expected
    assert type(load_robot(path.stem).lidar.num_beams) is int


def test_a_shipped_robot_is_loaded_without_a_warning_and_an_own_one_hears_of_its_radius(tmp_path, says):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for path in ROBOTS:
            load_robot(path.stem)
    own = tmp_path / "mine.yaml"
    own.write_text(
        (ROOT / "conf" / "robot" / "go2.yaml").read_text().replace("radius: 0.3 ", "radius: 0.25 ")
    )
    with says.warns():
        load_robot(own)


def test_a_file_may_be_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.yaml").write_text(STAGE)
    (tmp_path / "weights.yaml").write_text(find_weights("published").read_text(encoding="utf-8"))
    assert load_robot("~/mine.yaml") == load_robot("stage")
    assert load_parameters("~/weights.yaml") == load_parameters("published")


@pytest.mark.parametrize("folder", [".", "robot"])
def test_a_robots_file_inherits_those_beside_it(tmp_path, monkeypatch, folder):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "mine.yaml").write_text("defaults: [stage, _self_]\nname: mine\n")
    (tmp_path / "robot" / "fast.yaml").write_text("defaults: [mine, _self_]\nv_max: 2.0\n")
    monkeypatch.chdir(tmp_path / folder)
    fast = load_robot("fast.yaml" if folder == "robot" else "robot/fast.yaml")
    assert fast == replace(load_robot("stage"), name="mine", v_max=2.0)


def test_settings_without_a_group_are_one_line(says):
    with says.raises(InputError):
        load_settings("dwa")


def test_a_key_omitted_from_a_robots_file_is_the_default(tmp_path):
    path = tmp_path / "mine.yaml"
    left_out = ("  noise_std", "  x:", "  y:", "  yaw", "  length", "  width", "collision_radius")
    path.write_text("\n".join(line for line in STAGE.splitlines() if not line.startswith(left_out)))
    assert load_robot(path) == load_robot("stage")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("v_max: 0.5", "vmax: 0.5"),
        ("v_max: 0.5", ""),
        ("v_max: 0.5", "v_max: fast"),
        ("v_max: 0.5", "v_max: null"),
        ("v_max: 0.5", "v_max: -1"),
        ("num_beams: 540", "num_beams: 5.5"),
        ("num_beams: 540", "num_beams: true"),
        ("  range_max: 15.0", "  range: 15.0"),
        ("footprint:", "footprint: round\nrest:"),
    ],
)
def test_a_mistake_in_a_robots_file_is_one_line_that_names_it(tmp_path, old, new, says):
    path = tmp_path / "mine.yaml"
    assert old in STAGE
    path.write_text(STAGE.replace(old, new, 1))
    with says.raises(InputError):
        load_robot(path)


def test_settings_are_those_of_the_option_but_for_the_changes():
    shipped = load_settings("guide/lme")
    changed = load_settings("guide/lme", surmount="hidden", candidates={"number": 5})
    assert (changed.surmount, changed.candidates.number) == ("hidden", 5)
    assert changed.candidates.max_range == shipped.candidates.max_range
    assert load_settings("guide/lme") == shipped


def test_settings_that_are_changed_later_stay_ones_own():
    load_settings("guide/lme").candidates.number = 7
    assert load_settings("guide/lme").candidates.number == 300


@pytest.mark.parametrize(
    ("option", "changes", "said"),
    [
        ("planner/dwa", {"margn": 0.1}, r"^planner\.margn: no such key; did you mean margin\?"),
        ("planner/dwa", {"margin": -0.1}, r"^planner\.margin is -0\.1: must be at least 0"),
        ("guide/lme", {"candidates": {"number": 0}}, r"^guide\.candidates\.number is 0: must be at least 1"),
        ("planner/dwb", {}, r"^planner is 'dwb': did you mean dwa\?"),
    ],
)
def test_a_mistake_in_settings_names_the_key(option, changes, said):
    with pytest.raises(InputError, match=said):
        load_settings(option, **changes)


def test_the_published_parameters(tmp_path):
    published = load_parameters("published")
    assert load_parameters() == published
    assert list(published) == [*CRITERIA, "d1", "d2"]
    assert (published["c_o"], published["d1"]) == (999.8, 0.51)  # paper §IV.D
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({"parameters": published | {"d1": 2}}))
    assert load_parameters(path) == published | {"d1": 2.0}


@pytest.mark.usefixtures("no_own_weights")
def test_an_unknown_name_says_which_there_are(says):
    with says.raises(InputError, match="robot.*'jakal'"):
        load_robot("jakal")
    with says.raises(InputError, match="weights.*'mine'"):
        load_parameters("mine")


@pytest.mark.parametrize(
    "path",
    [
        p
        for p in sorted((ROOT / "conf" / "map").glob("[!_]*.yaml"))
        if p.stem not in ("building", "file", "tracks")
    ],
    ids=lambda path: path.stem,
)
def test_a_map_set_is_what_hydra_makes_of_its_file(path):
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        given = OmegaConf.to_container(compose(f"map/{path.stem}").map)
    robot = load_robot("stage")
    if "radius" in given:
        given["radius"] = robot.footprint.circumscribed_radius
    expected, made = build(given, "map"), load_map_set(path.stem, None, robot)
    assert type(made) is type(expected)
    assert made.numbers == expected.numbers
    number = made.numbers[-1]
    np.testing.assert_array_equal(made.task(number).world.circles, expected.task(number).world.circles)
    assert made.task(number).optimal_time == expected.task(number).optimal_time


def test_keys_of_fresh_worlds_are_refused_with_official_ones(says):
    assert load_map_set("barn", {"subset": "fresh", "count": 2, "fresh_seed": 5}).numbers == (1000, 1001)
    assert load_map_set("social", {"count": 2}, load_robot("stage")).numbers == (0, 1)
    for keys in ({"count": 100}, {"subset": "hard100", "fresh_seed": 5}):
        with says.raises(InputError):
            load_map_set("barn", keys)


@pytest.mark.parametrize("name", ["fast", "physics", "skid", "walking"])
def test_a_simulator_is_what_hydra_makes_of_its_file(name):
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        given = OmegaConf.to_container(compose(f"sim/{name}").sim)
    assert load_simulator(name) == configured(given, "sim")
    target, config = load_simulator(name, {"latency": 0.1, "goal_rate": None})
    assert (target, config.latency, config.goal_rate) == (configured(given, "sim")[0], 0.1, None)
