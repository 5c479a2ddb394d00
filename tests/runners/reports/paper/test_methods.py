"""The methods in words say what the records say."""

import pandas as pd
import pytest

from lme.worlds.cold_trial import ROBOT
from runners.records.launch_record import read_launch
from runners.reports.paper.methods import paragraphs
from runners.reports.paper.write import Recorded
from tests.composing import jobs_of, last_of_each
from tests.made_runs import write_run


@pytest.fixture
def said(tmp_path):
    """A function from the words of jobs to the paragraphs about them."""

    def words_of(*jobs, compared=False, **columns):
        with jobs_of() as job:
            for number, words in enumerate(jobs):
                write_run(
                    tmp_path / str(number),
                    job=job(*last_of_each("map=barn", *words)),
                    goal_tolerance_m=1.0,
                    **columns,
                )
        recorded = Recorded.read([tmp_path])
        return paragraphs(recorded.frame, list(map(read_launch, recorded.run_dirs)), compared)

    return words_of


def test_one_run_in_words(said, says):
    *texts, software = said(["sim=fast", "map.worlds=[200,201]", "runs=1"])
    says("\n\n".join(texts))
    assert "commit" in software or "driven by lme" in software
    assert "numpy" in software


def test_what_all_runs_share_is_said_once(said):
    shared = ["sim=fast", "map.worlds=[200,201]", "robot.v_max=1"]
    text = " ".join(said([*shared, "guide.history_length=5"], [*shared, "planner=dwa"]))
    assert text.count("robot.v_max=1") == 1
    assert text.count("guide.history_length=5") == 1
    assert "Every run was driven with " in text


@pytest.mark.parametrize("sim", ["gazebo", "walking"])
def test_no_reference_to_a_page(said, sim):
    assert "research/" not in "\n".join(said([f"sim={sim}", "map.worlds=[200]", "runs=1"]))


def test_a_cap_and_a_disc(said):
    _, robot, *_ = said(["sim=gazebo", "robot=jackal"])
    assert "Commands are limited to 1 m/s and 1.57 rad/s." in robot
    _, robot, *_ = said(["robot=turtlebot2", "sim=fast"])
    assert "turtlebot2 is a disc with a radius of " in robot


def test_each_robot_is_said_to_be_whose(said):
    _, robots, *_ = said(["sim=fast"], ["sim=fast", "robot.v_max=1"])
    assert "For LME: The robot jackal is a rectangle" in robots
    assert "For LME (robot.v_max=1): The robot jackal" in robots
    assert "up to 1 m/s and 4 rad/s" in robots


def test_each_simulator_is_said_to_be_whose(said):
    *_, worlds, _, _ = said(["sim=fast"], ["sim=gazebo", "robot.v_max=1"])
    assert "For LME: The simulator is lme's fast (" in worlds
    assert (
        "For LME (robot.v_max=1): The simulator is lme's gazebo (The BARN Challenge's Jackal in Gazebo"
        in worlds
    )
    assert "docs/" not in worlds


def test_people_who_are_added_to_the_worlds_are_named(said):
    *_, worlds, _, _ = said(["sim=fast"])
    assert "crowd" not in worlds
    *_, worlds, _, _ = said(["sim=fast"], ["sim=fast", "crowd=orca", "robot.v_max=1"])
    assert "For LME: Nobody is added to the worlds." in worlds
    assert "For LME (robot.v_max=1): The people of the crowd orca are added to every world (" in worlds
    assert "density=0.05, motion=orca," in worlds


def test_factors_on_parameters_are_named(said):
    systems, *_ = said(["sim=fast", "scale={c_o: 0.5}"])
    assert "the weight set published and factors on its parameters (c_o × 0.5)." in systems


def test_a_limit_that_the_path_decides_is_told_as_such(said):
    *_, worlds, _, _ = said(["sim=fast", "map=traps"])
    assert "or after a time that grows with the length of the shortest path." in worlds


def test_a_robot_of_each_episode_is_not_described(said):
    _, robots, *_ = said(["sim=fast"], robot=ROBOT)
    assert robots == "Every episode draws its robot; the records hold its size and limits."


def test_parts_that_are_not_as_shipped_are_named(said):
    systems, *_ = said(
        ["sim=fast"], ["sim=fast", "ablation=no_c_o", "filter=stopping"], ["sim=fast", "weights=skid"]
    )
    assert "the weight set published, the ablation no_c_o and the filter stopping." in systems
    assert "The weight set published is a_close = 1.51, " in systems
    assert "The weight set skid is a_close = 3.311, " in systems


def test_statistics_of_differences_are_told_only_where_there_are_any(said):
    *_, alone, _ = said(["sim=fast"])
    *_, compared, _ = said(["sim=fast"], compared=True)
    assert "Holm" not in alone
    assert "adjusted by Holm over all differences in one measure" in compared


def test_many_worlds_are_counted_and_not_listed():
    frame = pd.DataFrame(
        {"system": "LME", "map": "barn", "world": range(0, 60, 2), "run": 0, "run_dir": "x", "seed": 3}
    )
    text = " ".join(paragraphs(frame, [], False))
    assert "30 worlds (30 spans from 0 to 58), with 1 run of each configuration in each: 30 episodes" in text
    assert "from the seed (3)" in text
