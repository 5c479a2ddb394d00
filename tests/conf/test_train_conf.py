"""`conf/train.yaml`, the searches and the space: they compose, and they are the paper's."""

import dataclasses
import math

import pytest
from omegaconf import OmegaConf

from lme.errors import InputError
from runners.config import catalogue, schema
from runners.config.command_line import compose_job
from runners.config.composer import Composer, without_hydra
from runners.config.instantiate import configured
from runners.config.space import Range, own_values, read_space, with_values
from tests.builders import PUBLISHED

CATALOGUE = catalogue.shipped()


@pytest.fixture(scope="module")
def composer():
    schema.register()
    with Composer("train") as composer:
        yield composer


@pytest.mark.parametrize("option", CATALOGUE.options("search"))
def test_a_search_has_the_keys_of_its_config_class(composer, option):
    if option == "gp":
        pytest.importorskip("torch")
    config = without_hydra(composer.compose([f"search={option}"]))
    assert not OmegaConf.missing_keys(config)
    cls, _ = configured(config.search, "search")
    written = {key.name for key in CATALOGUE.keys(f"search/{option}")}
    assert written == {field.name for field in dataclasses.fields(cls.Config)}


def test_the_papers_experiment_is_its_training(composer):
    config = composer.compose(["experiment=train/paper"])
    assert (config.trials, config.configurations) == (150, 4)
    assert (config.race, config.start_from_config) == (None, False)
    assert (config.robot.name, config.map.name) == ("stage", "env1")
    assert (config.reward.crash, config.reward.timeout) == (-0.2, -0.2)
    assert config.map.time_limit * config.robot.control_rate == 200


def test_the_space_holds_the_papers_eight_and_its_optimum(composer):
    space = read_space(OmegaConf.to_object(without_hydra(composer.compose([]))))
    assert set(space) == {f"guide.parameters.{name}" for name in PUBLISHED}
    for name, value in PUBLISHED.items():
        found = space[f"guide.parameters.{name}"]
        assert 0 < found.low <= value <= found.high


def test_the_table1_experiment_is_one_study_and_two_maps(composer):
    config = composer.compose(["experiment=train/table1"])
    limits = {name: (node.name, node.time_limit) for name, node in config.held_out.items()}
    assert limits == {
        "env1": ("env1", 40), "env2": ("env2", 40), "env1_60s": ("env1", 60), "env2_60s": ("env2", 60),
        "env1_100s": ("env1", 100), "env2_100s": ("env2", 100),
    }  # fmt: skip
    assert (config.map.name, config.runs, config.held_out.env2.configurations) == ("env1", 3, 50)


@pytest.mark.parametrize("guide", ["target", "lme_plus"])
def test_a_space_with_that_of_the_planner_can_be_named(composer, guide):
    words = [f"guide={guide}", "planner=eband"]
    named, usual = (
        read_space(compose_job(composer, [*words, *more]).config) for more in ([f"space={guide}"], [])
    )
    assert named == usual
    assert any(key.startswith("planner.") for key in named)


def test_the_papers_own_search(composer):
    """A Gaussian process with few initial points in a uniform space; evaluated as Table I."""
    config = compose_job(composer, ["experiment=train/paper"]).config
    assert config.search == {"_target_": "runners.training.Gp", "batch": 1, "startup": 3}
    assert (config.trials, config.configurations, len(config.held_out)) == (150, 4, 6)
    assert not any(found.log for found in read_space(config).values())


def test_the_space_of_lme_plus_holds_its_values_and_its_planners(composer):
    words = ["experiment=train/tune", "guide=lme_plus"]
    config = compose_job(composer, [*words, "planner=min_time"]).config
    space = read_space(config)
    assert own_values(config, space).keys() == space.keys()
    assert {"guide.parameters.d2", "guide.travel.comfort", "planner.margin"} <= space.keys()
    without = read_space(compose_job(composer, [*words, "planner=dwa_tuned"]).config)
    assert not any(key.startswith("planner.") for key in without)  # it has no space


# The space


@pytest.fixture(scope="module")
def config(composer):
    given = compose_job(composer, []).config

    def with_space(space, ablation=None):
        guide = {"parameters": {"a": 1.0, "b": 2.0}}
        planner = {"gain": 4.0, "name": "x", "on": True}
        return dataclasses.replace(given, guide=guide, planner=planner, ablation=ablation or {}, space=space)

    return with_space


def test_a_space_mirrors_the_config(config):
    space = {
        "guide": {"parameters": {"a": {"low": 1, "high": 2, "log": True}}},
        "planner": {"gain": {"low": 0, "high": 1}},
    }
    found = read_space(config(space))
    assert found == {"guide.parameters.a": Range(1, 2, True), "planner.gain": Range(0, 1, False)}


def test_what_an_ablation_fixes_is_not_searched(config):
    space = {"guide": {"parameters": {name: {"low": 1, "high": 2} for name in "ab"}}}
    assert list(read_space(config(space, {"b": 0.0}))) == ["guide.parameters.a"]
    assert list(read_space(config(space), {"guide.parameters.a": 0.0})) == ["guide.parameters.b"]


def test_values_go_where_they_belong_and_the_config_stays_as_it_was(config):
    before = config({})
    after = with_values(before, {"guide.parameters.a": 9.0, "planner.gain": 8.0, "robot.v_max": 7.0})
    assert (after.guide["parameters"]["a"], after.planner["gain"], after.robot.v_max) == (9.0, 8.0, 7.0)
    assert before == config({})


@pytest.mark.parametrize(
    "space",
    [
        {},
        {"planner": {}},
        {"planner": 3},
        {"planner": {"gain": 3}},
        {"planner": {"gain": {"low": 1}}},
        {"planner": {"gain": {"low": 1, "high": "x"}}},
        {"planner": {"gain": {"low": 1, "high": 2, "lg": 1}}},
        {"planner": {"gain": {"low": 2, "high": 2}}},
        {"planner": {"gain": {"low": -1, "high": 2}}},
        {"planner": {"gain": {"low": 0, "high": 2, "log": True}}},
        {"planner": {"gain": {"low": 1, "high": math.inf}}},
        {"planner": {"gian": {"low": 1, "high": 2}}},
        {"planner": {"name": {"low": 1, "high": 2}}},
        {"planner": {"on": {"low": 0, "high": 1}}},
    ],
    ids=str,
)  # fmt: skip
def test_a_space_that_is_not_right(config, space, says):
    with says.raises(InputError):
        read_space(config(space))
