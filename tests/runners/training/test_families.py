"""The families of worlds of a training: which ones, with which robots, and which worlds."""

from dataclasses import asdict

import pytest

from lme.errors import InputError
from runners.config import build
from runners.training.families import (
    check_map_alone,
    describe_too_narrow,
    families,
    too_narrow,
    training_worlds,
    with_worlds,
)
from runners.workers.trials import check_disturbances, disturbed
from tests.composing import jobs_of


@pytest.fixture(scope="module")
def job():
    with jobs_of("train", "executor=serial", "tracking=none") as compose:
        yield compose


def found(job, *words):
    made = job(*words)
    return families(made.config, made.choices)


def test_the_default_is_three_families_and_barn_has_its_own_robot(job):
    trained = found(job)
    assert {name: family.robot.name for name, family in trained.items()} == {
        "env1": "stage",
        "fresh": "jackal",
        "indoor": "stage",
    }
    assert trained["fresh"].map["subset"] == "fresh"


@pytest.mark.parametrize(("robot", "narrow"), [("go2", ["fresh"]), ("turtlebot2", []), ("jackal_real", [])])
def test_a_family_that_is_too_narrow_is_left_out(job, robot, narrow):
    made = job(f"+robot={robot}")
    assert too_narrow(made.config) == narrow
    trained = families(made.config, made.choices)
    assert set(trained) == {"env1", "fresh", "indoor"} - set(narrow)
    assert trained["indoor"].robot.name == robot


def test_a_familys_own_robot_stands_in_for_smaller_ones_only(job):
    drivers = {robot: found(job, f"robot={robot}")["fresh"].robot.name for robot in ("stage", "jackal_real")}
    assert drivers == {"stage": "jackal", "jackal_real": "jackal_real"}


def test_a_chosen_map_is_trained_on_alone(job):
    assert set(found(job, "map=env2")) == {"env2"}
    assert too_narrow(job("map=barn", "+robot=go2").config) == []


def test_a_family_of_ones_own_and_a_robot_for_it(job):
    trained = found(job, "+map@training.mine=traps", "+robot@training_robots.mine=jackal")
    assert trained["mine"].robot.name == "jackal"
    assert trained["mine"].map["kind"] == "u"


def test_a_robot_of_no_family_is_refused(job, says):
    with says.raises(InputError):
        found(job, "+robot@training_robots.mine=turtlebot2")


@pytest.mark.parametrize("words", [["training.indor=null"], ["map=env2", "training.indor=null"]], ids=str)
def test_a_family_that_does_not_exist_cannot_be_left_out(job, words, says):
    with says.raises(InputError):
        found(job, *words)


def test_without_a_family_there_is_nothing_to_train_on(job, says):
    with says.raises(InputError):
        found(job, "training.env1=null", "training.indoor=null", "+robot=go2")


@pytest.mark.parametrize(
    "word", ["+map@training.own=barn", "training.fresh.count=9", "training_radius.fresh=0.5"]
)
def test_a_chosen_map_and_a_family_are_not_both_trained_on(job, word, says):
    made = job("map=env2", word)
    with says.raises(InputError):
        check_map_alone(made.choices["map"], made.overrides)


def test_a_chosen_map_may_come_with_families_left_out():
    check_map_alone("env2", ["map=env2", "training.env1=null", "training_numbers=[0,9]"])


def test_a_family_that_is_too_narrow_is_trained_on_where_its_radius_allows(job):
    text = describe_too_narrow(job("robot=go2").config)
    word = text.rpartition(" ")[2]
    assert word == "training_radius.fresh=0.41"
    assert "fresh" in found(job, "robot=go2", word)


def test_worlds_that_a_family_has_not_are_said_with_its_own_key(job, says):
    trained = found(job, "robot=jackal", "+map@training.own=barn")
    with says.raises(InputError):
        with_worlds({"own": trained["own"]}, [1_000_000])


def test_worlds_of_later_rungs_follow_those_of_the_search_and_none_is_held_out(job):
    made = job("training_numbers=[0,200]", "training.fresh.worlds=[0]", "training.indoor.count=40")
    trained = {
        name: family for name, family in families(made.config, made.choices).items() if name != "fresh"
    }
    few, many = (training_worlds(made.config, trained.values(), count) for count in (4, 60))
    assert many[:4] == few
    assert len(set(many)) == 60
    assert min(many) >= 50, "env1's own 50 configurations and 40 buildings are held out"
    worlds = with_worlds(trained, few)
    assert all(list(build.map_set(family).numbers) == few for family in worlds.values())


def test_disturbances_are_drawn_for_each_world_and_the_same_for_every_candidate(job):
    config = found(job, "map=env1", "disturbances={latency: [0.0, 0.1], slip: [0.02, 0.05]}")["env1"]
    one, again, other = (disturbed(config, world).sim for world in (3, 3, 4))
    assert one == again
    assert one["latency"] != other["latency"]
    assert 0.0 <= one["latency"] <= 0.1
    assert 0.02 <= one["slip"] <= 0.05
    assert one["scan_noise"] == config.sim["scan_noise"]
    assert disturbed(found(job, "map=env1")["env1"], 3).sim == config.sim


def test_every_disturbance_that_is_drawn_is_one_of_the_simulators(job):
    config = found(job, "map=env1", "sim=walking")["env1"]
    for key in asdict(config.disturbances):
        setattr(config.disturbances, key, [0.1, 0.2])
        assert config.disturbances.any
        drawn = disturbed(config, 3).sim
        assert {name for name, value in drawn.items() if value != config.sim[name]} == {key}
        assert 0.1 <= drawn[key] <= 0.2
        setattr(config.disturbances, key, None)
    assert not config.disturbances.any


def test_a_planner_that_knows_the_delay_knows_the_drawn_one(job):
    words = "map=env1", "guide=lme_plus", "planner=min_time", "disturbances={latency: [0.02, 0.1]}"
    drawn = disturbed(found(job, *words)["env1"], 3)
    assert drawn.planner["latency"] == drawn.sim["latency"] > 0.0
    assert disturbed(found(job, *words, "planner.latency=0.2")["env1"], 3).planner["latency"] == 0.2


@pytest.mark.parametrize(
    "words",
    [
        ["disturbances.slip=[0.1]"],
        ["disturbances.slip=[-1,1]"],
        ["disturbances.slip=[0.2,0.1]"],
        ["disturbances.overshoot_v=[0,2]"],
        ["disturbances.tilt=[0,0.05]"],
    ],
    ids=" ".join,
)
def test_disturbances_that_cannot_be_drawn(job, words, says):
    with says.raises(InputError):
        check_disturbances(found(job, "map=env1", *words)["env1"])
