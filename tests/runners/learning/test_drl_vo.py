"""A DRL-VO network in torch against the one that onnxruntime runs."""

import numpy as np
import pytest

from lme.config.presets import load_robot, load_settings
from lme.inputs.onnx_file import TRAINED, SignedNetwork
from lme.planners.drl_vo.observation import image_of
from lme.planners.drl_vo.planner import PEDESTRIANS, DrlVoInterface
from lme.planners.drl_vo.weights import SIGNATURE, Sizes, read_weights, shapes, write_weights
from lme.types import LaserScan, Twist
from tests.builders import observation, stage
from tests.networks import TINY, random_drl_vo, signed
from tests.tolerances import FLOAT32_LAYER, KERNEL, NETWORK

torch = pytest.importorskip("torch")

from runners.learning import distributions  # noqa: E402
from runners.learning.drl_vo import SMALL, DrlVoCritic, DrlVoNetwork  # noqa: E402

ROBOT = stage(v_max=3.0, omega_max=3.0, alpha_v=100.0, alpha_omega=100.0)  # reaches any command in a period


@pytest.fixture
def network():
    made = DrlVoNetwork()
    made.load(random_drl_vo())
    return made


def inputs(count, seed=1):
    rng = np.random.default_rng(seed)
    people = np.zeros((count, PEDESTRIANS, 4))
    people[:, -2:] = rng.uniform([0.0, -9.0, -1.0, -1.0], [9.0, 9.0, 1.0, 1.0], (count, 2, 4))
    return rng.uniform(-1.0, 1.0, (count, 20, 80)), people, rng.uniform(-1.0, 1.0, (count, 2))


def tensors(arrays):
    return [torch.from_numpy(array.astype(np.float32)) for array in arrays]


def test_weights_of_any_size_go_in_and_come_out_unchanged(network):
    for sizes in (TINY, Sizes(3, 7, 5)):
        wanted = random_drl_vo(sizes)
        network.load(wanted)
        found = network.weights()
        assert {name: array.shape for name, array in found.items()} == {**shapes(sizes), TRAINED: (2,)}
        for name in set(wanted) - {TRAINED}:
            np.testing.assert_array_equal(found[name], wanted[name])


def test_a_new_one_is_small_and_says_what_it_was_trained_for(tmp_path):
    made = DrlVoNetwork()
    made.trained_for(load_settings("planner/drl_vo", v_max=1.5, omega_max=0.75), [load_robot("jackal")])
    with (tmp_path / "w.onnx").open("wb") as file:
        made.write(made.weights(), file)
    weights = read_weights(tmp_path / "w.onnx")
    assert {name: array.shape for name, array in weights.items()} == shapes(SMALL)
    assert SignedNetwork(tmp_path / "w.onnx", SIGNATURE).trained.tolist() == [1.5, 0.75]


def test_the_torch_network_answers_as_the_planner_does(network, tmp_path):
    sweeps, people, goals = inputs(5)
    with torch.no_grad():
        answer = network(*tensors((sweeps, people, goals)))
    own = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, network.weights())
    for i in range(5):
        means = own.answer(image_of(sweeps[i], people[i]), goals[i])[0]
        assert answer.mu[i, 0].tanh().numpy() == pytest.approx(np.clip(means, -1.0, 1.0), abs=2e-3)


def test_the_torch_network_with_fitted_norms_answers_as_the_planner_does(network, tmp_path):
    sweeps, people, goals = inputs(16)
    network.train()
    for _ in range(3):
        network(*tensors((sweeps, people, goals)))
    network.eval()
    with torch.no_grad():
        network.output.weight *= 0.1  # so that no answer is cut off
        answer = network(*tensors((sweeps, people, goals)))
    own = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, network.weights())
    means = [own.answer(image_of(sweeps[i], people[i]), goals[i])[0] for i in range(16)]
    assert answer.mu[:, 0].tanh().numpy() == pytest.approx(np.array(means), abs=NETWORK)


def test_every_weight_is_trained():
    torch.manual_seed(0)
    network = DrlVoNetwork()
    output = network(*tensors(inputs(16)))
    loss = output.log_density(torch.zeros(16, 2)).sum()
    gradients = torch.autograd.grad(loss, list(network.parameters()))
    assert all(bool((gradient != 0).any()) for gradient in gradients)


def test_an_answer_that_is_cut_off_can_still_be_trained(network):
    with torch.no_grad():
        network.output.bias += 5.0
    output = network(*tensors(inputs(4)))
    assert (output.mu.tanh() > 0.99).all()
    loss = -distributions.log_likelihood(output, torch.zeros(4, 2), 0.03).mean()
    (gradient,) = torch.autograd.grad(loss, [network.output.bias])
    assert (gradient > 0.0).all()


def test_mirrored_features_are_those_of_the_mirrored_scene(network):
    ranges = np.random.default_rng(3).uniform(0.5, 4.0, 540).astype(np.float32)
    people = np.array([[3.0, 1.0, 0.5, -0.2], [6.0, -4.0, 0.0, 1.0]])
    interface = DrlVoInterface(load_settings("planner/drl_vo", pedestrians=True), ROBOT)
    seen = interface.features(_seen(ranges, people), np.array([1.0, 0.6]))
    interface.clear()
    across = np.array([1.0, -1.0])
    mirrored = interface.features(
        _seen(ranges[::-1].copy(), people * np.tile(across, 2)), np.array([1.0, -0.6])
    )
    one = tensors([each[None] for each in seen])
    turned, actions = network.mirror(tuple(one), torch.tensor([[0.3, 0.4]]))
    for found, wanted in zip(turned, mirrored, strict=True):
        assert found[0].numpy() == pytest.approx(wanted, abs=1e-5)
    assert actions.tolist() == [pytest.approx([0.3, -0.4])]


def _seen(ranges, people):
    """The beams lie symmetrically, and none on the edge of two bins."""
    increment = 2 * np.pi / 541
    scan = LaserScan(ranges, -269.5 * increment, increment, 0.1, 30.0)
    return observation(robot=ROBOT)._replace(scan=scan, pedestrians=people)


def test_a_command_and_its_answer():
    interface = DrlVoInterface(load_settings("planner/drl_vo", v_max=2.0, omega_max=1.5, v_free=3.0), ROBOT)
    for ahead, fastest in ((1.0, 2.0), (4.0, 3.0)):
        seen = observation(ranges=np.full(540, ahead, np.float32), robot=ROBOT)
        action = interface.action(Twist(0.5, -0.75), seen)
        assert action == pytest.approx([2.0 * 0.5 / fastest - 1.0, -0.5])
        assert interface.command(action, seen) == pytest.approx((0.5, -0.75), abs=KERNEL)
        assert interface.action(Twist(-0.2, 9.0), seen).tolist() == [-1.0, 1.0]


def test_a_critic_values_scenes_and_several_actions_in_them():
    scene = tensors(inputs(3))
    assert DrlVoCritic(0)(*scene).shape == (3,)
    critic, actions = DrlVoCritic(2), torch.rand(3, 4, 2)
    values = critic(*scene, actions)
    assert values.shape == (3, 4)
    for k in range(4):
        assert critic(*scene, actions[:, k]).detach().numpy() == pytest.approx(
            values[:, k].detach().numpy(), abs=FLOAT32_LAYER
        )
