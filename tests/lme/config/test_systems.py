"""load_system: any system by name, the same as `lme eval system=NAME` to the last bit."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import lme
from lme.errors import InputError
from runners.config import build, catalogue
from tests.builders import observation
from tests.composing import jobs_of

ROBOT = lme.load_robot("jackal")
IMPORTED = {"maer_nav", "drl_nsuo"}  # need networks that do not ship
SYSTEMS = [name for name in catalogue.shipped().options("system") if name not in IMPORTED]
TASK = lme.Barn(lme.load_settings("map/barn", worlds=[282], time_limit=4.0)).task(282)


@pytest.fixture(scope="module")
def job_of():
    with jobs_of("eval", "map=barn", "robot=jackal") as compose:
        yield compose


def driven(navigator):
    simulator = lme.FastSimulator(lme.load_settings("sim/fast"), ROBOT)
    return lme.run_episode(TASK, navigator, simulator, np.random.default_rng(3))


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_drives_as_on_the_command_line(name, job_of):
    expected = driven(build.navigator(job_of(f"system={name}", "sim=fast").config, ROBOT))
    found = driven(lme.load_system(name, ROBOT))
    np.testing.assert_array_equal(found.trajectory, expected.trajectory)
    assert (found.outcome, found.path_length, found.switches, found.min_clearance) == (
        expected.outcome,
        expected.path_length,
        expected.switches,
        expected.min_clearance,
    )


@pytest.mark.parametrize(
    ("words", "keywords"),
    [
        (["system=lme", "planner=dwa_tuned"], {"planner": "dwa_tuned"}),
        (["system=lme", "ablation=[no_c_o,no_c_h]"], {"ablation": ["no_c_o", "no_c_h"]}),
        (["system=lme", "cap.v_max=1", "cap.omega_max=1.5"], {"cap": {"v_max": 1.0, "omega_max": 1.5}}),
        (["system=lme", "weights=skid"], {"weights": "skid"}),
        (
            ["system=lme", "filter=stopping", "filter.margin=0.1"],
            {"filter": "stopping", "filter.margin": 0.1},
        ),
        (
            ["system=lme", "guide.candidates.number=40", "planner.kp=1.0"],
            {"guide.candidates.number": 40, "planner.kp": 1.0},
        ),
    ],
)
def test_changes_are_those_of_the_command_line(words, keywords, job_of):
    expected = driven(build.navigator(job_of("sim=fast", *words).config))
    np.testing.assert_array_equal(
        driven(lme.load_system("lme", ROBOT, **keywords)).trajectory, expected.trajectory
    )
    assert not np.array_equal(driven(lme.load_system("lme", ROBOT)).trajectory, expected.trajectory)


def test_a_system_by_its_path_finds_the_options_beside_it(tmp_path, monkeypatch):
    for group, text in (
        ("planner", "_target_: lme.planners.simple.Simple\nkp: 1.0\n"),
        ("ablation", "# @package _global_\nguide: {candidates: {number: 40}}\n"),
        (
            "system",
            "# @package _global_\ndefaults:\n  - override /guide: lme\n  - override /planner: mine\n"
            "  - override /ablation: mine\n",
        ),
    ):
        (tmp_path / "c" / group).mkdir(parents=True)
        (tmp_path / "c" / group / "mine.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    expected = driven(lme.load_system("lme", ROBOT, **{"planner.kp": 1.0, "guide.candidates.number": 40}))
    found = driven(lme.load_system("c/system/mine.yaml", ROBOT))
    np.testing.assert_array_equal(found.trajectory, expected.trajectory)
    with pytest.raises(InputError, match=r"^planner is 'mime': did you mean mine\?"):
        lme.load_system("c/system/mine.yaml", ROBOT, planner="mime")


class Own:
    """A planner whose keys are not those of the system's."""

    @dataclass
    class Config:
        speed: float = 0.5

    def __init__(self, config, robot):
        self.speed = config.speed

    def reset(self, rng): ...

    def plan(self, observation, guidance):
        return lme.Twist(self.speed, 0.0)


def test_a_class_of_the_users_own_has_its_own_keys():
    target = {"planner._target_": f"{__name__}.Own"}
    assert lme.load_system("lme", ROBOT, **target).planner.speed == 0.5
    assert lme.load_system("lme", ROBOT, **target, **{"planner.speed": 0.8}).planner.speed == 0.8
    with pytest.raises(InputError, match="unknown key 'heading_tolerance'"):
        lme.load_system("lme", ROBOT, planner="simple", **target)


@pytest.mark.parametrize(
    ("name", "keywords"),
    [
        ("lme_pluss", {}),
        ("lme", {"planner": "dwa_tune"}),
        ("lme", {"weights": "publishd"}),
        ("lme", {"planner.kpp": 1.0}),
        ("lme", {"planer.kp": 1.0}),
        ("lme", {"guide.history_length": "eight"}),
        ("dwa", {"weights": "published"}),
        ("lme", {"ablation": "no_c_x"}),
        ("dwa_tuned", {"ablation": "no_c_h"}),
        ("lme", {"goal_tolerance": -1.0}),
        ("lme", {"cap": {"v_max": 0.0}}),
        ("lme", {"cap": {"v": 1.0}}),
    ],
    ids=str,
)  # fmt: skip
@pytest.mark.usefixtures("no_own_weights")
def test_mistakes_are_named(name, keywords, says):
    with says.raises(InputError):
        lme.load_system(name, ROBOT, **keywords)


def test_explanation_and_reason_are_there():
    navigator = lme.load_system("lme_plus", ROBOT)
    assert navigator.explanation() is None
    navigator.act(observation((5.0, 0.0), robot=ROBOT))
    assert lme.reason(navigator.explanation())


def test_it_stops_within_the_tolerance_of_the_goal():
    navigator = lme.load_system("lme", ROBOT, goal_tolerance=0.5)
    assert navigator.act(observation((0.4, 0.2), robot=ROBOT)) == lme.Twist(0.0, 0.0)
    assert navigator.act(observation((0.6, 0.0), robot=ROBOT)) != lme.Twist(0.0, 0.0)


def test_guides_without_parameters_take_those_that_ship():
    for config, name in ((lme.Lme, "lme"), (lme.LmePlus, "lme_plus")):
        guide = config(lme.load_settings(f"guide/{name}", parameters={}), ROBOT)
        found, expected = (
            driven(lme.Navigator(each, lme.Simple(lme.load_settings("planner/simple"), ROBOT)))
            for each in (guide, lme.load_system(name, ROBOT).guide)
        )
        np.testing.assert_array_equal(found.trajectory, expected.trajectory)


def test_parameters_of_both_policies_are_read_by_name():
    assert "a_rest" in lme.load_parameters("lme_plus")
    assert lme.load_parameters()["c_o"] == 999.8
    assert lme.load_parameters("skid")["c_o"] != 999.8


def test_cast_sees_discs_and_walls_from_the_mount():
    lidar = lme.Lidar(4, 2 * math.pi, 0.1, 10.0, x=0.5)
    scan = lme.cast(lidar, lme.Pose(1.0, 0.0, math.pi / 2), [[1.0, 3.0, 0.5]], [[-1.0, -5.0, -1.0, 5.0]])
    assert scan.angle_min == -math.pi
    np.testing.assert_allclose(scan.ranges, [10.0, 10.0, 2.0, 2.0], atol=1e-6)
