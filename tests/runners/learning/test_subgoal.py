"""The subgoal network in torch against lme's own, its mirror, and the robots that it drives."""

import numpy as np
import pytest

from lme.config.presets import load_robot, load_settings
from lme.guides.learned_subgoal.guide import SubgoalInterface
from lme.guides.learned_subgoal.network import (
    BEARINGS,
    CANDIDATES,
    RANGES,
    REPORTED,
    SHAPES,
    SIGNATURE,
    STATE_INPUTS,
    candidates,
    write_weights,
)
from lme.inputs.onnx_file import TRAINED
from lme.simulation.fast import FastSimulator
from lme.worlds.world import World
from runners.config.schema import RobotRanges
from runners.workers.trials import extremes
from tests.builders import CLUTTER, stage, task
from tests.networks import random_subgoal, signed
from tests.tolerances import FLOAT32_LAYER, NETWORK

torch = pytest.importorskip("torch")

from runners.learning.distributions import ChoiceBatch  # noqa: E402
from runners.learning.driving import SubgoalFollower  # noqa: E402
from runners.learning.subgoal import SubgoalCritic, SubgoalNetwork  # noqa: E402


@pytest.fixture(scope="module")
def network():
    made = SubgoalNetwork()
    made.load(random_subgoal())
    return made


def inputs(count, seed=1):
    rng = np.random.default_rng(seed)
    free = rng.integers(0, 2, (count, CANDIDATES)).astype(float)
    return rng.random((count, BEARINGS)), free, rng.normal(size=(count, STATE_INPUTS))


def tensors(arrays):
    return tuple(torch.from_numpy(array.astype(np.float32)) for array in arrays)


def test_weights_go_in_and_come_out_unchanged(network):
    weights, found = random_subgoal(), network.weights()
    assert set(found) == set(weights)
    for name in SHAPES:
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], weights[name])


def test_the_file_says_what_the_network_was_trained_for(network):
    ranges = RobotRanges(v_max=[0.5, 1.5], length=[0.3, 0.6], width=[0.2, 0.4])
    network.trained_for(load_settings("guide/learned_subgoal"), extremes(load_robot("jackal"), ranges))
    spans = dict(zip(REPORTED, network.weights()[TRAINED].tolist(), strict=True))
    assert spans["v_max"] == [0.5, 1.5]
    assert spans["omega_max"] == [4.0, 4.0]
    assert spans["length"] == pytest.approx([0.3, 0.6])


def test_the_torch_network_answers_as_the_guide_does(network, tmp_path):
    arrays = inputs(5)
    with torch.no_grad():
        answer = network(*tensors(arrays)).logits.numpy()
    own = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, network.weights())
    for i in range(5):
        (logits,) = own.answer(*(array[i] for array in arrays))
        np.testing.assert_array_equal(np.isneginf(answer[i]), np.isneginf(logits))
        free = np.isfinite(logits)
        assert answer[i, free] == pytest.approx(logits[free], abs=NETWORK)


def test_sharpness_multiplies_the_logits(network, tmp_path):
    one = [array[0] for array in inputs(1)]
    sharp, plain = (
        signed(SIGNATURE, tmp_path / "w.onnx", write_weights, network.weights(factor)).answer(*one)[0]
        for factor in (3.0, 1.0)
    )
    free = np.isfinite(plain)
    assert sharp[free] == pytest.approx(3.0 * plain[free], abs=NETWORK)


def test_every_weight_is_trained():
    torch.manual_seed(0)
    network = SubgoalNetwork()
    answer = network(*tensors(inputs(64)))
    chosen = answer.draw(torch.Generator().manual_seed(0))
    gradients = torch.autograd.grad(answer.log_density(chosen).sum(), list(network.parameters()))
    assert all(bool(torch.isfinite(gradient).all() & (gradient != 0).any()) for gradient in gradients)


def test_choices_are_drawn_by_probability_and_their_density_is_its_logarithm():
    logits = torch.log(torch.tensor([[0.25, 0.0, 0.75]])).expand(20_000, -1)
    answer = ChoiceBatch(logits)
    drawn = answer.draw(torch.Generator().manual_seed(0))
    counts = torch.bincount(drawn, minlength=3).tolist()
    assert counts[1] == 0
    assert counts[2] / 20_000 == pytest.approx(0.75, abs=0.02)
    assert answer.log_density(drawn)[drawn == 2][0].item() == pytest.approx(np.log(0.75), abs=FLOAT32_LAYER)


def test_a_mirrored_scene_has_mirrored_features_and_choices(network):
    """By the interface's own features of a scene and of its mirror image."""
    robot = stage(fov=1.5 * np.pi, num_beams=700)
    scenes = []
    for side in (1.0, -1.0):
        world = World(circles=CLUTTER.circles * [1, side, 1], segments=CLUTTER.segments * [1, side, 1, side])
        simulator, interface = (
            FastSimulator(load_settings("sim/fast"), robot),
            SubgoalInterface(load_settings("guide/learned_subgoal"), robot),
        )
        simulator.reset(task(world, goal=(4.0, 1.5 * side)), np.random.default_rng(0))
        seen = simulator.step((0.3, 0.4 * side))
        scenes.append(interface.features(seen, seen.target))
    one, other = (tensors([array[None] for array in scene]) for scene in scenes)
    number = 5 * len(RANGES) + 2
    turned, choice = network.mirror(one, torch.tensor([number]))
    for found, wanted in zip(turned, other, strict=True):
        assert found.numpy() == pytest.approx(wanted.numpy(), abs=1e-3)
    assert candidates()[choice.item()] == pytest.approx(candidates()[number] * [1.0, -1.0])


def test_a_critic_values_scenes():
    assert SubgoalCritic(0)(*tensors(inputs(3))).shape == (3,)


def test_in_training_a_subgoal_is_what_the_guide_makes_of_it():
    """It gives its planner the chosen candidate, and keeps it in place after that."""
    robot = stage()
    told = []

    class Listener:
        def plan(self, observation, guidance):
            told.append(guidance)
            return (0.2, 0.1)

    follower = SubgoalFollower(
        SubgoalInterface(load_settings("guide/learned_subgoal", period=0.4), robot), Listener()
    )
    assert follower.steps == 2
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    seen = simulator.reset(task(CLUTTER), np.random.default_rng(0))
    follower.features(seen, seen.target)
    follower.take(np.float64(9.0))
    seen = simulator.step(follower.command(seen))
    follower.command(seen)
    assert [each.switched for each in told] == [True, False]
    assert told[0].subgoal == pytest.approx(candidates()[9])
    assert 0.0 < np.hypot(*(told[1].subgoal - told[0].subgoal)) < 0.1
