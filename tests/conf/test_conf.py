"""Every YAML of `conf/`: it composes, its keys are those of the class it configures, and they are explained."""

import dataclasses
import importlib
import warnings
from typing import get_type_hints

import pytest
import yaml
from omegaconf import OmegaConf

from lme.config.composer import SHIPPED
from lme.guides.lme_plus.criteria import CRITERIA as PLUS_CRITERIA
from lme.inputs.resources import resource_dir
from lme.live.config import LiveConfig
from lme.robots import Robot
from lme.worlds.check import check_task
from runners.cli.main import command_files
from runners.config import build, catalogue, systems
from runners.config.changes import flatten
from runners.config.composer import without_hydra
from runners.config.instantiate import configured, dataclass_of
from runners.records import launch_record
from runners.reports.analysis.published import TEXTS
from tests.composing import composed, jobs_of

CONF = resource_dir("conf")
CATALOGUE = catalogue.shipped()
GROUPS = CATALOGUE.groups("eval")
CUSTOM = "custom"  # takes a class of the user's own
OPTIONS = [(group, option) for group in GROUPS for option in CATALOGUE.options(group) if option != CUSTOM]
COMMENTED = 0.8  # share of the keys of a file that have a comment
PARAMETERS = {"a_close", "a_dev", "c_o", "c_t", "a_mount", "c_h", "d1", "d2"}
SIX = {"a_close", "a_dev", "c_o", "c_t", "a_mount", "c_h"}


def chosen(group, option):
    """The config with an option."""
    return composed("eval", f"{group}={option}")


def _fields(config_class, prefix=""):
    for name, annotation in get_type_hints(config_class).items():
        part = dataclass_of(annotation)
        if part:
            yield from _fields(part, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_option_composes(group, option):
    config = without_hydra(chosen(group, option))
    assert not OmegaConf.missing_keys(config)
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "error", message=".*usually", category=UserWarning
        )  # of lme.inputs.plausibility
        assert launch_record.identity(OmegaConf.to_object(config))
        if "_target_" in CATALOGUE.values(f"{group}/{option}"):
            configured(config[group], group)


@pytest.mark.parametrize(
    ("group", "option"), [pair for pair in OPTIONS if "_target_" in CATALOGUE.values("/".join(pair))]
)
def test_keys_are_those_of_the_config_class(group, option):
    config = without_hydra(chosen(group, option))
    cls, _ = configured(config[group], group)
    written = {key.name for key in CATALOGUE.keys(f"{group}/{option}")}
    assert written == set(_fields(cls.Config))
    module, _, name = str(config[group]._target_).rpartition(".")
    assert getattr(importlib.import_module(module), name) is cls


def _own_target(path):
    """The class that a YAML itself names, rather than one that it inherits from; None for one of the user's."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    return content.get("_target_", "???") if isinstance(content, dict) and path.stem != CUSTOM else "???"


def _with_defaults(config_class):
    """Yield the fields of a config and of its parts that have a default."""
    for field in dataclasses.fields(config_class):
        part = dataclass_of(get_type_hints(config_class)[field.name])
        yield from _with_defaults(part) if part else ()
        if (field.default, field.default_factory) != (dataclasses.MISSING, dataclasses.MISSING):
            yield field.name


@pytest.mark.parametrize(
    "path",
    [path for path in sorted(CONF.rglob("*.yaml")) if _own_target(path) != "???"],
    ids=lambda path: str(path.relative_to(CONF)),
)
def test_the_yaml_is_the_only_home_of_a_value(path):
    config = _class(_own_target(path)).Config
    if not issubclass(config, LiveConfig):  # robots' own programs build it, too
        assert not list(_with_defaults(config))


def _class(target):
    module, _, name = target.rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)
    except ModuleNotFoundError as error:
        if error.name != "torch":
            raise
        pytest.skip(f"{target} needs torch")


@pytest.mark.parametrize("option", CATALOGUE.options("robot"))
def test_robot_keys_are_those_of_the_robot(option):
    given = OmegaConf.to_container(chosen("robot", option).robot)
    assert set(given) == {field.name for field in dataclasses.fields(Robot)}
    written = {key.name.partition(".")[0] for key in CATALOGUE.keys(f"robot/{option}")}
    assert written == set(given)
    assert given["name"] == option


@pytest.mark.parametrize("path", sorted(CONF.rglob("*.yaml")), ids=lambda path: str(path.relative_to(CONF)))
def test_every_file_is_explained(path):
    name = str(path.relative_to(CONF).with_suffix(""))
    assert len(CATALOGUE.title(name)) > 10
    keys = [key for key in CATALOGUE.keys(name) if key.name not in ("_target_", "name")]
    if name == "published" or (name.startswith("system/") and name != "system/lme"):
        return  # the first comments, or those of lme.yaml, explain the keys
    if keys:
        assert sum(bool(key.comment) for key in keys) / len(keys) >= COMMENTED


def test_every_yaml_is_reached_by_a_command():
    commands = {path.stem for path in CONF.glob("*.yaml")} - {"published"}
    assert commands <= set(command_files())
    groups = {
        "weight_set",
        "space/planner",
        *(group for name in commands for group in CATALOGUE.groups(name)),
    }
    groups |= {f"experiment/{name}" for name in commands}
    reached = {f"{group}/{option}" for group in groups for option in CATALOGUE.options(group)} | commands
    reached.add("published")  # tables read it
    reached.add("map/_cold_trial")  # of experiment/cold_trial alone, because no other command can draw robots
    assert set(CONF.rglob("*.yaml")) == {file for name in reached for file in CATALOGUE.option(name).files}


def test_the_defaults_are_the_papers_main_experiment():
    config = composed("eval")
    choices = {group: config.hydra.runtime.choices.get(group) for group in GROUPS}
    assert choices | {"system": None, "experiment": None} == choices
    assert [choices[group] for group in ("robot", "map", "guide", "planner")] == [
        "jackal",
        "barn",
        "lme",
        "simple",
    ]
    assert (config.seed, config.runs, config.weights, config.resume) == (0, 3, "published", False)


def test_no_group_bears_the_name_of_a_plain_key():
    """Hydra takes `key=value` for a choice of group wherever a folder of that name exists."""
    plain = {key.name for name in ("eval", "train") for key in CATALOGUE.keys(name)}
    assert not plain & {path.name for path in CONF.iterdir() if path.is_dir()}


# Ablations


@pytest.mark.parametrize("name", sorted(SIX))
def test_an_ablation_sets_one_weight_to_zero(name):
    config = chosen("ablation", f"no_{name}")
    assert OmegaConf.to_container(config.ablation) == {name: 0.0}
    intact = chosen("ablation", "none").guide.parameters
    assert dict(config.guide.parameters) == {**intact, name: 0.0}


def test_no_maintenance_never_keeps_a_subgoal():
    assert OmegaConf.to_container(chosen("ablation", "no_maintenance").ablation) == {"d1": float("inf")}
    assert OmegaConf.to_container(chosen("ablation", "none").ablation) == {}


def test_ablations_add_up():
    config = composed("eval", "ablation=[no_c_o,no_c_t]")
    assert OmegaConf.to_container(config.ablation) == {"c_o": 0.0, "c_t": 0.0}


OF_LME = ["none", *(f"no_{name}" for name in sorted(SIX)), "no_maintenance"]
OF_PLUS = [name for name in CATALOGUE.options("ablation") if name not in OF_LME]
OF_BOTH = ["no_a_dev", "no_c_o", "no_maintenance"]


def test_there_are_the_papers_seven_ablations_and_those_of_lme_plus():
    assert set(OF_LME) < set(CATALOGUE.options("ablation"))
    assert {f"no_{name}" for name in PLUS_CRITERIA} <= {*OF_PLUS, *OF_BOTH}


@pytest.mark.parametrize("option", [*OF_PLUS, *OF_BOTH])
def test_a_part_of_lme_plus_is_removed_by_one_value(option):
    changed, complete = set(), chosen("system", "lme_plus")
    ablated = composed("eval", "system=lme_plus", f"ablation={option}")
    for resolve in (False, True):  # a latency is 0 here, however it is written; weights are one reference
        whole, without = (_pair(config, resolve) for config in (complete, ablated))
        assert whole.keys() == without.keys()
        changed |= {key for key in whole if whole[key] != without[key]}
    assert len(changed) == 1


def _pair(config, resolve):
    """Dotted keys of guide and planner, as written or with their values."""
    parts = {group: OmegaConf.to_container(config[group], resolve=resolve) for group in ("guide", "planner")}
    return dict(flatten(parts))


def test_every_part_of_lme_plus_is_removed_in_its_experiment():
    """The complete method is the first. Nothing is delayed and nobody walks there, so two would change nothing."""
    config = chosen("experiment", "lme_plus_ablation")
    swept = [name.strip() for name in config.hydra.sweeper.params.ablation.split(",")]
    assert swept[0] == "none"
    assert set(swept) == {"none", *OF_BOTH, *OF_PLUS} - {"no_latency", "no_people"}
    assert config.hydra.runtime.choices["system"] == "lme_plus"


def test_the_gait_table_drives_a_walking_go2_from_starts_of_its_own():
    """Each of its maps has a way for the Go2. Other experiments use the numbers 0 to 99."""
    swept = chosen("experiment", "gait").hydra.sweeper.params.map.split(",")
    assert len(swept) == 8
    for name in swept:
        words = ["experiment=gait", "hydra.mode=RUN", f"map={name}", "system=lme"]
        with jobs_of("eval", *words) as job:
            config = job().config
        assert config.sim["natural_frequency_v"] > 0.0
        maps = build.map_set(config)
        assert len(maps.numbers) == 20
        assert min(maps.numbers) > 99
        assert config.robot.name == "go2"
        check_task(maps.task(maps.numbers[0]), config.robot)


def test_maps_have_clocks_of_their_own_only_where_that_is_asked_for():
    for name, rates in (("move_base_gazebo", (10.0, 20.0)), (None, (None, None))):
        config = chosen("experiment", name) if name else composed("eval", "system=move_base", "sim=fast")
        assert (config.guide.costmap.update_rate, config.planner.costmap.update_rate) == rates
        assert config.hydra.runtime.choices["system"] == ("move_base_as_run" if name else "move_base")


@pytest.mark.parametrize("option", [name for name in CATALOGUE.options("ablation") if name != "none"])
def test_every_ablation_has_a_label_of_its_own(option):
    labels = systems.ablation_labels()
    assert labels[option].startswith("without ")
    assert list(labels.values()).count(labels[option]) == 1


# Published values


def test_the_published_weights():
    published = dict(composed("eval").guide.parameters)
    assert published == {
        "a_close": 1.51, "a_dev": 1.56, "c_o": 999.8, "c_t": 205.84, "a_mount": 88.7, "c_h": 134.9,
        "d1": 0.51, "d2": 200.0,
    }  # fmt: skip
    assert set(published) == PARAMETERS


@pytest.mark.parametrize("option", CATALOGUE.options("system"))
def test_a_system_is_the_pair_that_its_file_chooses(option):
    """Read as data, and chosen on the command line, it is the same pair."""
    config, system = chosen("system", option), systems.systems()[option]
    choices = config.hydra.runtime.choices
    assert (system.guide, system.planner) == (choices["guide"], choices["planner"])
    assert system.global_planner == ("global_map" in config.guide)
    assert config.system.label == system.label
    assert systems.system_of(system.guide, system.planner, SHIPPED, option) == {option: system}


def test_published_figures_are_rates_of_systems_that_there_are():
    table = CATALOGUE.values("published")
    assert set(table) <= set(CATALOGUE.options("system"))
    for figures in (figures for maps in table.values() for figures in maps.values()):
        assert figures["robots"]
        assert all((CONF / "robot" / f"{robot}.yaml").is_file() for robot in figures["robots"])
        rates = sum(figures[outcome][0] for outcome in ("success", "collision", "timeout"))
        assert rates == pytest.approx(1.0, abs=0.0101)  # rounded to two digits
        assert all(
            0 <= deviation < 0.05 for key in figures if key not in TEXTS for deviation in figures[key][1:]
        )
