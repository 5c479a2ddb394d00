"""DRL-VO with random weights: what the network is given, what is done with its answer, and what is refused."""

import warnings
from unittest import mock

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.planners.drl_vo import DrlVo
from lme.planners.drl_vo.weights import write_weights
from lme.types import Guidance, Twist
from tests.builders import observation, shipped, stage
from tests.networks import drl_vo_file, network_file, random_drl_vo
from tests.tolerances import KERNEL

ROBOT = stage(v_max=3.0, omega_max=3.0, alpha_v=100.0, alpha_omega=100.0)  # reaches any command in a period
STRAIGHT = Guidance(np.array([4.0, 0.0]))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return str(drl_vo_file(tmp_path_factory.mktemp("weights") / "random.onnx"))


class Recorder:
    """A network that keeps what it is given and always answers the same."""

    def __init__(self, means):
        self._means = np.array(means)
        self.deviations, self.trained = np.array([0.3, 0.1]), np.full(2, np.inf)
        self.goal = None

    def answer(self, image, goal):
        self.image, self.goal = image, goal
        return self._means, self.deviations


def config(name, file, **settings):
    return load_settings(f"planner/{name}", weights=file, **settings)


def made(file, name="drl_vo_barn", means=(0.5, -0.25), robot=ROBOT, **settings):
    network = Recorder(means)
    with mock.patch("lme.planners.drl_vo.planner.SignedNetwork", return_value=network):
        planner = DrlVo(config(name, file, **settings), robot)
    planner.reset(np.random.default_rng(0))
    return planner, network


def ranges(*returns, nothing=np.inf):
    """Ranges of `stage`; returns: (bearing [degrees], range [m])."""
    seen = np.full(540, nothing, np.float32)
    for bearing, reach in returns:
        seen[round((bearing + 180.0) / 360.0 * 540)] = reach
    return seen


def seen(*returns, **changes):
    return observation(ranges=ranges(*returns), robot=ROBOT, **changes)


def test_the_original_answers_up_to_half_a_metre_and_two_radians(file):
    planner, _ = made(file, "drl_vo", deterministic=True)
    assert planner.plan(seen(), STRAIGHT) == pytest.approx((0.75 * 0.5, -0.25 * 2.0), abs=KERNEL)


@pytest.mark.parametrize(("ahead", "v_max"), [(2.3, 2.0), (2.1, 0.5)])
def test_the_barn_entry_drives_fast_where_the_way_ahead_is_free(file, ahead, v_max):
    planner, _ = made(file)
    command = planner.plan(seen((40.0, ahead), (60.0, 0.5)), STRAIGHT)
    assert command == pytest.approx((0.75 * v_max, -0.25 * 0.7), abs=KERNEL)


@pytest.mark.parametrize(("name", "margin"), [("drl_vo", 0.4), ("drl_vo_barn", 0.45)])
def test_drl_vo_turns_left_in_place_before_an_obstacle_ahead(file, name, margin):
    planner, network = made(file, name)
    assert planner.plan(seen((-30.0, margin - 0.01)), STRAIGHT) == pytest.approx((0.0, 0.7))
    assert network.goal is None
    planner.plan(seen((-30.0, margin + 0.01)), STRAIGHT)
    assert network.goal is not None


def test_the_command_is_limited_to_what_the_robot_can(file):
    robot = stage()  # 0.5 m/s; 0.4 m/s and 0.4 rad/s in a period
    planner, _ = made(file, means=(1.0, -1.0), robot=robot)
    command = planner.plan(observation(robot=robot, twist=Twist(0.0, 0.0)), STRAIGHT)
    assert command == pytest.approx((0.4, -0.4), abs=KERNEL)


def test_answers_beyond_one_are_cut(file):
    planner, _ = made(file, means=(3.0, -3.0))
    assert planner.plan(seen(), STRAIGHT) == pytest.approx((2.0, -0.7), abs=KERNEL)


def test_the_original_draws_its_action(file):
    planner, network = made(file, "drl_vo", means=(0.0, 0.0))
    commands = np.array([planner.plan(seen(), STRAIGHT) for _ in range(2000)])
    actions = commands / [0.25, 2.0] - [1.0, 0.0]
    assert actions.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.03)
    assert actions.std(axis=0) == pytest.approx(network.deviations, rel=0.1)


@pytest.mark.parametrize(
    ("name", "lookahead", "pedestrians"), [("drl_vo", 2.0, True), ("drl_vo_barn", 1.0, False)]
)
def test_the_network_gets_the_people_and_the_goal(file, name, lookahead, pedestrians):
    planner, network = made(file, name)
    people = np.array([[5.0, 0.0, 1.0, -1.0]])
    planner.plan(seen((10.0, 3.0))._replace(pedestrians=people), Guidance(np.array([0.0, 9.0])))
    assert network.goal == pytest.approx([0.0, 1.0])
    assert network.image.shape == (3, 80, 80)
    assert network.image.dtype == np.float32
    assert network.image[1:].any() == pedestrians
    planner.plan(seen(target=(9.0, 9.0)), Guidance(np.array([0.0, 0.5 * lookahead])))
    assert network.goal == pytest.approx([0.0, 0.5])


def test_the_sub_goal_is_where_the_path_leaves_the_disc(file):
    planner, network = made(file, lookahead=2.0)
    corner = np.array([[0.0, 0.0], [1.5, 0.0], [1.5, 5.0]])
    planner.plan(seen(), Guidance(np.array([1.0, 0.0]), corner))
    assert 2.0 * network.goal == pytest.approx([1.5, (4.0 - 1.5**2) ** 0.5])
    planner.plan(seen(), Guidance(np.array([1.0, 0.0]), corner[:2]))
    assert 2.0 * network.goal == pytest.approx([1.5, 0.0])


def test_while_no_path_is_found_the_sub_goal_stays(file):
    planner, network = made(file)
    lost = Guidance(np.zeros(2), np.array([[0.0, 0.0], [-4.0, 0.0]]), blocked=True)
    assert planner.plan(seen(), lost) == pytest.approx((0.0, 0.0))  # there is none yet
    planner.plan(seen(), Guidance(np.zeros(2), np.array([[0.0, 0.0], [0.0, 4.0]])))
    network.goal = None
    planner.plan(seen(), lost)
    assert network.goal == pytest.approx([0.0, 1.0])
    planner.reset(np.random.default_rng(0))
    assert planner.plan(seen(), lost) == pytest.approx((0.0, 0.0))


def test_drl_vo_stops_near_the_end_of_the_path_or_near_the_target(file):
    planner, _ = made(file)
    for end, stops in ((0.14, True), (0.16, False)):
        point = np.array([end, 0.0])
        along = Guidance(point, np.vstack([np.zeros(2), point]))
        assert (planner.plan(seen(target=(end, 0.3)), along) == (0.0, 0.0)) == stops
        assert (planner.plan(seen(target=(end, 0.0)), Guidance(point)) == (0.0, 0.0)) == stops
    near_subgoal = Guidance(np.array([0.1, 0.0]))
    assert planner.plan(seen(target=(5.0, 0.0)), near_subgoal).v > 0.0


def test_a_real_network_answers_and_a_seed_decides(file):
    robot = shipped("jackal")
    planner = DrlVo(config("drl_vo", file), robot)
    commands = []
    for _ in range(2):
        planner.reset(np.random.default_rng(3))
        given = observation(robot=robot, ranges=np.full(720, 2.0, np.float32))
        commands.append([planner.plan(given, STRAIGHT) for _ in range(3)])
    assert commands[0] == commands[1]
    assert len(set(commands[0])) == 3


def test_sample_and_running_norms_differ(tmp_path):
    answers = []
    for batch_norm in ("sample", "running"):
        with (tmp_path / batch_norm).open("wb") as written:
            write_weights(random_drl_vo(), written, batch_norm)
        planner = DrlVo(config("drl_vo_barn", str(tmp_path / batch_norm)), ROBOT)
        planner.reset(np.random.default_rng(0))
        answers.append(planner.plan(seen((20.0, 2.0)), STRAIGHT))
    assert answers[0] != pytest.approx(answers[1], abs=1e-6)


def test_missing_weights_and_those_of_another_network_are_refused(tmp_path, says):
    with says.raises(InputError, match="weights.*null"):
        DrlVo(load_settings("planner/drl_vo"), ROBOT)
    other = network_file(tmp_path / "dclp.onnx")
    with says.raises(InputError):
        DrlVo(load_settings("planner/drl_vo", weights=str(other)), ROBOT)


def test_speeds_outside_of_the_training_are_named(file, says):
    with says.warns():
        DrlVo(load_settings("planner/drl_vo", weights=file, v_max=1.0), ROBOT)
    slow = stage(omega_max=1.0)
    with says.warns():
        DrlVo(load_settings("planner/drl_vo", weights=file), slow)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        DrlVo(config("drl_vo_barn", file), slow)
