"""DRL-DCLP's network in torch against lme's own."""

import math

import numpy as np
import pytest

from lme.config.presets import load_robot, load_settings
from lme.inputs.onnx_file import TRAINED
from lme.planners.dclp.planner import DclpInterface, Mixture
from lme.planners.dclp.weights import REPORTED, SHAPES, SIGNATURE, write_weights
from lme.robots import Footprint
from lme.types import Twist
from runners.config.schema import RobotRanges
from runners.workers.trials import extremes
from tests.builders import observation, stage
from tests.networks import random_weights, signed
from tests.tolerances import FLOAT32_LAYER, NETWORK

torch = pytest.importorskip("torch")

from runners.learning import distributions  # noqa: E402
from runners.learning.dclp import DclpNetwork  # noqa: E402


@pytest.fixture(scope="module")
def network():
    made = DclpNetwork()
    made.load(random_weights())
    return made


def inputs(count, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 3.0, (count, 90, 6)), rng.normal(size=(count, 8))


def tensors(arrays):
    return [torch.from_numpy(array.astype(np.float32)) for array in arrays]


def test_weights_go_in_and_come_out_unchanged(network):
    weights = random_weights()
    found = network.weights()
    assert set(found) == set(weights)
    for name in SHAPES:
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], weights[name])


def test_the_file_says_what_the_network_was_trained_for(network):
    robot = load_robot("jackal")
    ranges = RobotRanges(v_max=[0.5, 1.5], length=[0.3, 0.6], width=[0.2, 0.4])
    network.trained_for(load_settings("planner/dclp"), extremes(robot, ranges))
    spans = dict(zip(REPORTED, network.weights()[TRAINED].tolist(), strict=True))
    assert spans["v_max"] == [0.5, 1.5]
    assert spans["omega_max"] == [robot.omega_max, robot.omega_max]
    assert spans["front"] == pytest.approx([0.15, 0.3])
    assert spans["half_width"] == pytest.approx([0.1, 0.2])


def test_the_torch_network_answers_as_the_planner_does(network, tmp_path):
    directions, state = inputs(5)
    with torch.no_grad():
        output = network(*tensors((directions, state)))
    own = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, network.weights())
    for i in range(5):
        answer = Mixture(*own.answer(directions[i], state[i]))
        assert output.logits[i].numpy() == pytest.approx(answer.logits, abs=NETWORK)
        assert output.mu[i].tanh().numpy() == pytest.approx(answer.means, abs=NETWORK)


def test_every_weight_is_trained(network):
    output = network(*tensors(inputs(16)))
    loss = output.log_density(torch.zeros(16, 2)).sum()
    gradients = torch.autograd.grad(loss, list(network.parameters()))
    assert all(bool((gradient != 0).any()) for gradient in gradients)


def one(logits, mu, sigma):
    """The output of a network that answers this, once."""
    return distributions.MixtureBatch(
        *(torch.tensor([value]) for value in (logits, mu, np.log(sigma).tolist()))
    )


def test_density_by_hand():
    output = one([math.log(0.25), math.log(0.75)], [[0.0, 0.0], [1.0, -1.0]], [[1.0, 1.0], [0.5, 2.0]])
    second = 0.75 * math.exp(-0.5 * (1.0 + 0.25)) / math.tau
    point = torch.tensor([[0.5, 0.0]])
    first = 0.25 * math.exp(-0.5 * 0.25) / math.tau
    assert output.log_density(point).item() == pytest.approx(math.log(first + second), abs=FLOAT32_LAYER)


def test_density_of_actions_sums_to_one():
    output = one([0.2, -0.1], [[0.3, -0.5], [-0.8, 0.4]], [[0.4, 0.6], [0.7, 0.5]])
    grid = torch.linspace(-0.9995, 0.9995, 2000)
    actions = torch.cartesian_prod(grid, grid)
    many = distributions.MixtureBatch(*(value.expand(len(actions), *value.shape[1:]) for value in output))
    density = distributions.log_density_of_actions(many, actions.atanh()).exp()
    assert density.sum().item() * (grid[1] - grid[0]).item() ** 2 == pytest.approx(1.0, abs=0.01)


def test_actions_are_drawn_by_probability_with_their_deviation():
    output = one([math.log(0.25), math.log(0.75)], [[-3.0, 0.0], [3.0, 1.0]], [[0.1, 0.2], [0.3, 0.5]])
    many = distributions.MixtureBatch(*(value.expand(20_000, *value.shape[1:]) for value in output))
    drawn = many.draw(torch.Generator().manual_seed(0))
    right = drawn[drawn[:, 0] > 0]
    assert len(right) / len(drawn) == pytest.approx(0.75, abs=0.02)
    assert right.mean(0).numpy() == pytest.approx([3.0, 1.0], abs=0.02)
    assert right.std(0).numpy() == pytest.approx([0.3, 0.5], abs=0.02)


def test_an_expert_s_full_command_is_likely_and_no_deviation_counts_as_less():
    sharp = one([0.0], [[9.0, 9.0]], [[1e-6, 1e-6]])
    full = torch.ones(1, 2)
    wanted = -2 * math.log(0.1) - math.log(math.tau)
    assert distributions.log_likelihood(sharp, full, 0.1).item() == pytest.approx(wanted, abs=FLOAT32_LAYER)


def test_a_mirrored_scene_has_a_mirrored_answer_by_the_planner_s_own_features():
    robot = stage(fov=1.5 * math.pi, num_beams=720, footprint=Footprint(length=0.5, width=0.3))
    interface = DclpInterface(load_settings("planner/dclp"), robot)
    ranges = np.random.default_rng(3).uniform(0.5, 3.0, robot.lidar.num_beams).astype(np.float32)
    seen = interface.features(_seen(robot, ranges, 0.4), np.array([1.0, 0.6]))
    mirrored = interface.features(_seen(robot, ranges[::-1].copy(), -0.4), np.array([1.0, -0.6]))
    (directions, state), actions = DclpNetwork().mirror(
        tuple(tensors([array[None] for array in seen])), torch.tensor([[0.3, 0.2]])
    )
    ordered = lambda rows: rows[np.lexsort(rows.T)]  # noqa: E731
    np.testing.assert_allclose(
        ordered(directions[0].numpy().round(3)), ordered(mirrored.directions.round(3)), atol=2e-3
    )
    assert state[0].numpy() == pytest.approx(mirrored.state, abs=FLOAT32_LAYER)
    assert actions.numpy() == pytest.approx(np.array([[0.3, -0.2]]))


def _seen(robot, ranges, omega):
    seen = observation(robot=robot, twist=Twist(0.3, omega))
    return seen._replace(scan=seen.scan._replace(ranges=ranges))
