"""DRL-DCLP with random weights: what the network is given, what is done with its answer, and what is refused."""

import warnings
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.inputs.onnx_file import SignedNetwork
from lme.planners.dclp.planner import Dclp, Mixture, draw
from lme.planners.dclp.weights import SIGNATURE, write_weights
from lme.robots import Footprint
from lme.types import Guidance, Twist
from tests import oracles
from tests.builders import observation, stage
from tests.networks import network_file, random_weights, signed
from tests.tolerances import KERNEL, NETWORK

REPORTED = {"alpha_v": 3.0, "alpha_omega": 2.5}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return str(network_file(tmp_path_factory.mktemp("weights") / "random.onnx"))


class Recorder:
    """A network that keeps what it is given and always answers the same."""

    def __init__(self, means):
        self.means = np.full((4, 2), means)
        self.trained = np.tile([-np.inf, np.inf], (7, 1))

    def answer(self, directions, state):
        self.directions, self.state = directions.copy(), state
        return np.zeros(4), self.means


def made(file, robot, means=(0.5, -0.25), **settings):
    network = Recorder(means)
    with mock.patch("lme.planners.dclp.planner.SignedNetwork", return_value=network):
        planner = Dclp(load_settings("planner/dclp", weights=file, **settings), robot)
    planner.reset(np.random.default_rng(0))
    return planner, network


def test_the_network_by_hand(tmp_path):
    """The layers in float64, one after the other."""
    weights, rng = random_weights(), np.random.default_rng(1)
    directions, state = rng.uniform(0.1, 3.0, (90, 6)), rng.normal(size=8)
    x = directions.copy()
    x[:, 2] = 1.0 / (x[:, 2] + weights["alpha"])
    layer = lambda x, name, slope=0.2: oracles.dense(  # noqa: E731
        x, weights[f"{name}.kernel"], weights[f"{name}.bias"], slope
    )
    for name in ("convolution_1", "convolution_2", "convolution_3"):
        x = layer(x, name)
    x = np.concatenate((x.max(axis=0), state))
    for name in ("dense_1", "dense_2", "dense_3", "dense_4"):
        x = layer(x, name)
    out = layer(x, "output", 1.0).reshape(4, 5)
    network = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, weights)
    mixture = Mixture(*network.answer(directions, state))
    assert mixture.logits == pytest.approx(out[:, 0], abs=NETWORK)
    assert mixture.means == pytest.approx(np.tanh(out[:, 1:3]), abs=NETWORK)


def test_the_order_of_the_directions_means_nothing(file):
    network, rng = SignedNetwork(Path(file), SIGNATURE), np.random.default_rng(2)
    directions, state = rng.uniform(0.1, 3.0, (90, 6)), rng.normal(size=8)
    one, other = network.answer(directions, state), network.answer(rng.permutation(directions), state)
    np.testing.assert_array_equal(one[1], other[1])


def test_components_are_drawn_by_their_probability():
    odds = np.array([0.1, 0.2, 0.3, 0.4])
    mixture = Mixture(np.log(odds) + 700.0, np.arange(8.0).reshape(4, 2))
    rng = np.random.default_rng(0)
    drawn = np.array([draw(mixture, rng)[0] / 2 for _ in range(4000)])
    assert np.bincount(drawn.astype(int)) / 4000 == pytest.approx(odds, abs=0.03)


def test_the_network_gets_the_goal_twist_limits_and_footprint(file):
    robot = stage(footprint=Footprint(length=0.4, width=0.3))
    planner, network = made(file, robot)
    planner.plan(observation(twist=Twist(0.3, -0.1), robot=robot), Guidance(np.array([0.0, 2.0])))
    assert network.state == pytest.approx([2.0, np.pi / 2, 0.3, -0.1, *robot.limits[:4]])
    assert network.directions[7, 3:] == pytest.approx([0.2, 0.2, 0.15])


def test_a_disc_is_given_to_the_network_as_a_square_and_settings_win(file):
    robot = stage()
    planner, network = made(file, robot, reported_limits={"v_max": 0.4, "rear": 0.3, **REPORTED})
    planner.plan(observation(robot=robot), Guidance(np.array([1.0, 0.0])))
    assert network.directions[0, 3:] == pytest.approx([0.2, 0.3, 0.2])
    assert network.state[4:] == pytest.approx([0.4, robot.omega_max, 3.0, 2.5])


def test_the_output_is_scaled_by_the_limits_given_and_limited_to_the_robots(file):
    robot = stage()  # 0.4 m/s and 0.4 rad/s in a period
    planner, _ = made(file, robot, reported_limits={"v_max": 0.4})
    command = planner.plan(observation(robot=robot), Guidance(np.array([1.0, 0.0])))
    assert command == pytest.approx((0.5 * 0.4, -0.25 * robot.omega_max), abs=KERNEL)
    planner, _ = made(file, robot, (-1.0, 1.0), reported_limits={"v_max": 2.0})
    command = planner.plan(observation(robot=robot), Guidance(np.array([1.0, 0.0])))
    assert command == pytest.approx((-0.4, 0.4), abs=KERNEL)


def test_a_full_output_may_mean_less_than_the_limits_given(file):
    planner, network = made(file, stage(), full_v=0.3, full_omega=1.0)
    seen = observation(robot=stage(), twist=Twist(0.1, -0.2))
    command = planner.plan(seen, Guidance(np.array([2.0, 0.0])))
    assert command == pytest.approx((0.5 * 0.3, -0.25 * 1.0))
    assert network.state[4:6] == pytest.approx(stage().limits[:2])


@pytest.mark.parametrize(
    ("length", "blocked", "goal"), [(9.0, False, 6.0), (5.0, False, 5.0), (9.0, True, 1.0)]
)
def test_along_a_path_the_goal_is_its_first_point_far_enough(file, length, blocked, goal):
    robot = stage()
    planner, network = made(file, robot, lookahead=6.0)
    path = np.column_stack((np.arange(0.0, length + 0.1, 0.25), np.zeros(round(length * 4) + 1)))
    planner.plan(observation(robot=robot), Guidance(np.array([1.0, 0.0]), path, blocked=blocked))
    assert network.state[0] == pytest.approx(goal)


@pytest.mark.parametrize(
    ("ahead", "aside", "goal"), [(3.6, 6.0, "point"), (3.4, 6.0, "end"), (-4.0, 6.0, "end")]
)
def test_the_goal_itself_is_given_once_it_is_near_enough_ahead(file, ahead, aside, goal):
    """Ahead along x, however far it is: the path leads 6.5 m to the left, then to its end."""
    planner, network = made(file, stage(), lookahead=6.0, goal_within=3.5)
    path = np.array([[0.0, 0.0], [0.0, 3.0], [0.0, 6.5], [ahead, aside]])
    planner.plan(observation(robot=stage()), Guidance(np.array([1.0, 0.0]), path))
    x, y = (0.0, 6.5) if goal == "point" else (ahead, aside)
    assert network.state[:2] == pytest.approx([np.hypot(x, y), np.arctan2(y, x)])


def test_weights_that_do_not_exist(tmp_path, says):
    with says.raises(InputError):
        Dclp(load_settings("planner/dclp", weights=str(tmp_path / "none.onnx")), stage())


def test_a_robot_outside_of_the_training_is_named(tmp_path, says):
    file = str(network_file(tmp_path / "narrow.onnx", trained={"alpha_v": (0.5, 5.0)}))
    with says.warns():
        Dclp(load_settings("planner/dclp", weights=file), stage(alpha_v=20.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Dclp(
            load_settings("planner/dclp", weights=file, reported_limits={"alpha_v": 5.0}), stage(alpha_v=20.0)
        )
