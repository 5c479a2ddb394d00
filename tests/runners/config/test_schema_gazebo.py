"""`sim=gazebo`: where it is the default, and what it brings along for systems and maps."""

import pytest

from lme.config.composer import SHIPPED
from lme.robots import Cap
from runners.config.catalogue import Catalogue
from runners.config.schema import COMMANDS
from tests.composing import composed, jobs_of

CATALOGUE = Catalogue(SHIPPED)
LAB_START, START = -2.0, -2.25  # x [m]
MAPS = [name for name in CATALOGUE.options("map") if name not in ("building", "file")]  # need a path
EXPERIMENTS = CATALOGUE.options("experiment")
SKIDDING = ("barn_entries", "lme_plus_skid", "robustness_friction", "robustness_latency", "robustness_speed")
NAMED = {  # what an experiment names where it is not `fast`
    **dict.fromkeys(("table2", "ablation", "move_base_gazebo"), "gazebo"),
    **dict.fromkeys(SKIDDING, "skid"),
    "gait": "walking",
    "jackal_mujoco": "mujoco",
}


def job(*words, command="eval"):
    with jobs_of(command, "tracking=none") as job_of:
        return job_of(*words)


def sim(command, *words):
    return composed(command, *words).hydra.runtime.choices["sim"]


class TestTheSimulatorThatNobodyNamed:
    @pytest.mark.parametrize("map_set", MAPS)
    @pytest.mark.parametrize("robot", CATALOGUE.options("robot"))
    def test_barns_robot_in_barn_is_in_gazebo(self, map_set, robot):
        expected = "gazebo" if (map_set, robot) == ("barn", "jackal") else "fast"
        assert sim("eval", f"map={map_set}", f"robot={robot}") == expected

    @pytest.mark.parametrize("named", CATALOGUE.options("sim"))
    def test_a_typed_one_wins(self, named):
        assert sim("eval", f"sim={named}") == named
        assert sim("eval", "experiment=table2", f"sim={named}", "hydra.mode=RUN") == named

    @pytest.mark.parametrize("experiment", EXPERIMENTS)
    def test_every_experiment_names_its_own(self, experiment):
        found = sim("eval", f"experiment={experiment}", "hydra.mode=RUN")
        assert found == NAMED.get(experiment, "fast")

    @pytest.mark.parametrize("robot", CATALOGUE.options("robot"))
    @pytest.mark.parametrize("command", [name for name in COMMANDS if name not in ("eval", "replay")])
    def test_other_commands_stay_fast(self, command, robot):
        assert sim(command, f"robot={robot}") == "fast"


class TestWhatItBringsAlong:
    def test_the_laboratorys_start_on_its_own_worlds_alone(self):
        starts = {
            subset: job(f"map.subset={subset}").config.map["start"][0]
            for subset in ("lab100", "official50", "fresh")
        }
        assert starts == {"lab100": LAB_START, "official50": START, "fresh": START}
        assert job("sim=fast").config.map["start"][0] == START
        assert job("map.start=[-2.1,3,1.57]").config.map["start"][0] == -2.1

    def test_a_cap_for_systems_without_their_own(self):
        assert job("system=lme").config.cap == Cap(1.0, 1.57)
        assert job("system=move_base").config.cap == Cap()
        assert job("system=lme", "sim=fast").config.cap == Cap()
        assert job("system=lme_as_run", "sim=fast").config.cap == Cap(1.0, 1.57)
        assert job("system=lme_as_run", "cap.v_max=0.7").config.cap == Cap(0.7, 1.57)

    def test_lme_plus_for_gazebo_is_given_the_outline_that_collides(self):
        robot = job("system=lme_plus_gazebo").config.robot
        assert robot.footprint == robot.drivetrain.contact
        assert robot.footprint != job("system=lme_plus").config.robot.footprint

    @pytest.mark.parametrize(
        ("words", "rates"),
        [
            (["sim=gazebo"], (10.0, 20.0)),
            (["sim=fast"], (None, None)),
            (["sim=fast", "costmap_clocks=true"], (10.0, 20.0)),
            (["sim=gazebo", "costmap_clocks=false"], (None, None)),
        ],
    )
    def test_the_clocks_of_costmaps(self, words, rates):
        config = job("system=move_base", *words).config
        assert (config.guide["costmap"]["update_rate"], config.planner["costmap"]["update_rate"]) == rates

    def test_only_what_is_typed_is_a_change(self):
        assert job("system=lme").changes == job("system=move_base_as_run").changes == {}
        typed = job("system=lme_as_run", "cap.v_max=2", "feedback=OPEN_LOOP", "costmap_clocks=false").changes
        assert typed == {"cap.v_max": 2.0, "feedback": "OPEN_LOOP", "costmap_clocks": False}
        assert job("system=lme", "robot.footprint.width=0.33").changes == {"robot.footprint.width": 0.33}


def test_drives_trains_and_plays_with_one_word():
    for command in ("figure", "play", "train", "learn"):
        with jobs_of(command) as job_of:
            assert job_of("sim=gazebo").config.cap == Cap(1.0, 1.57)
