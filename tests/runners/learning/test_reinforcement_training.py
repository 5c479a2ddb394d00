"""The parts of PPO and SAC by hand, and the robots that they drive."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.gym.episodes import Reward
from lme.planners.dclp.planner import DclpInterface
from lme.robots import Footprint
from tests.composing import jobs_of
from tests.tolerances import FLOAT32_LAYER

torch = pytest.importorskip("torch")

from runners.learning import distributions  # noqa: E402
from runners.learning.dclp import DclpCritic, DclpNetwork  # noqa: E402
from runners.learning.driving import Driving, Experience  # noqa: E402
from runners.learning.learnable import network_class  # noqa: E402
from runners.learning.ppo_training import Batch, PpoStep, PpoTraining, advantages_of  # noqa: E402
from runners.learning.reinforcement_training import Parts  # noqa: E402
from runners.learning.sac_training import Replay, ReplaySteps, SacTraining, lower_value, next_features  # noqa: E402


def features(count, seed=0):
    rng = np.random.default_rng(seed)
    arrays = rng.uniform(0.1, 3.0, (count, 90, 6)), rng.normal(size=(count, 8))
    return tuple(torch.from_numpy(array.astype(np.float32)) for array in arrays)


# PPO


def step(values, rewards, ended):
    number = torch.tensor(values)
    return PpoStep((), number, number, number, torch.tensor(rewards), torch.tensor(ended))


def test_advantages_by_hand():
    """Two robots; the episode of the second ends in the first step."""
    steps = [step([1.0, 2.0], [0.5, -1.0], [False, True]), step([3.0, 4.0], [1.0, 0.0], [False, False])]
    found = advantages_of(steps, torch.tensor([5.0, 6.0]), gamma=0.9, decay=0.5)
    second = [1.0 + 0.9 * 5.0 - 3.0, 0.0 + 0.9 * 6.0 - 4.0]
    first = [0.5 + 0.9 * 3.0 - 1.0 + 0.45 * second[0], -1.0 - 2.0]
    assert found.numpy() == pytest.approx([*first, *second], abs=FLOAT32_LAYER)


def test_the_policy_learns_what_was_better():
    """Turning left was worth more than turning right: after some updates it is likelier."""
    torch.manual_seed(0)
    policy, critic = DclpNetwork(), DclpCritic(0)
    learner = PpoTraining(load_settings("learner/ppo", epochs=20, batch=32, kl_max=1e9))
    parts = Parts(
        {"critic": critic},
        {
            "policy_optimiser": torch.optim.Adam(policy.parameters(), 2e-4),
            "critic_optimiser": torch.optim.Adam(critic.parameters(), 1e-3),
        },
        torch.Generator().manual_seed(0),
    )
    inputs = features(64)
    with torch.no_grad():
        answer = policy(*inputs).with_min_sigma(0.1)
        raw = answer.draw(parts.generator)
        before = answer.log_density(raw)
    left = (raw[:, 1] > 0).float()
    batch = Batch(inputs, raw, before, left, torch.full((64,), 7.0))
    learner._update(policy, parts, batch, learn_policy=True)
    with torch.no_grad():
        change = policy(*inputs).with_min_sigma(0.1).log_density(raw) - before
        values = critic(*inputs)
    assert change[left > 0].mean() > 0.1 > -0.1 > change[left == 0].mean()
    assert abs(values.mean() - 7.0) < 2.0


# SAC


def test_replay_keeps_the_newest_steps():
    replay = Replay(5, torch.device("cpu"))
    for first in (0, 3):
        numbers = torch.arange(first, first + 3).float()
        inputs = (numbers[:, None], numbers[:, None, None].expand(-1, 2, 2))
        replay.add(ReplaySteps(inputs, numbers[:, None].expand(-1, 2), numbers, numbers > 4, inputs))
    drawn = replay.sample(200, torch.Generator().manual_seed(0))
    assert sorted(set(drawn.rewards.tolist())) == [1.0, 2.0, 3.0, 4.0, 5.0]
    torch.testing.assert_close(drawn.features[0][:, 0], drawn.rewards)
    torch.testing.assert_close(drawn.following[1][:, 1, 1], drawn.rewards)
    torch.testing.assert_close(drawn.terminated, drawn.rewards > 4)


def test_the_features_after_an_end_are_those_seen_there():
    seen, last = features(3, 1), features(1, 2)
    flags = torch.zeros(3, dtype=torch.bool)
    found = next_features(Experience(seen, torch.zeros(3), flags, flags, torch.tensor([1]), last))
    for each, next_one, end in zip(found, seen, last, strict=True):
        torch.testing.assert_close(each[1], end[0])
        torch.testing.assert_close(each[[0, 2]], next_one[[0, 2]])


def test_a_critic_values_several_actions_in_a_scene_as_one_by_one():
    torch.manual_seed(0)
    critics = torch.nn.ModuleList([DclpCritic(2), DclpCritic(2)])
    inputs, actions = features(3), torch.rand(3, 4, 2)
    together = lower_value(critics, inputs, actions)
    alone = torch.stack([lower_value(critics, inputs, actions[:, k]) for k in range(4)], 1)
    torch.testing.assert_close(together, alone, atol=FLOAT32_LAYER, rtol=0.0)
    both = torch.stack([critic(*inputs, actions[:, 0]) for critic in critics])
    torch.testing.assert_close(alone[:, 0], both.min(0).values)


def test_the_worth_of_a_step_by_hand():
    """Where an episode ended the reward alone counts; elsewhere what follows and its entropy count too."""
    torch.manual_seed(0)
    policy = DclpNetwork()
    targets = torch.nn.ModuleList([DclpCritic(2), DclpCritic(2)])
    inputs, rewards = features(2), torch.tensor([1.0, -10.0])
    batch = ReplaySteps(inputs, torch.zeros(2, 2), rewards, torch.tensor([False, True]), inputs)
    learner = SacTraining(load_settings("learner/sac", alpha=0.5, gamma=0.9))
    parts = Parts({"targets": targets}, {}, torch.Generator().manual_seed(3))
    wanted = learner._target_values(policy, parts, batch)
    with torch.no_grad():
        answer = policy(*inputs).with_min_sigma(0.1)
        raw = answer.draw(torch.Generator().manual_seed(3))
        follows = lower_value(targets, inputs, raw.tanh()) - 0.5 * distributions.log_density_of_actions(
            answer, raw
        )
    assert wanted.numpy() == pytest.approx([1.0 + 0.9 * follows[0].item(), -10.0], abs=FLOAT32_LAYER)


# Driving


@pytest.fixture(scope="module")
def config():
    words = ["training.fresh_hard.subset=fresh", "robots.v_max=[0.5,2]", "robots.length=[0.3,0.5]"]
    with jobs_of("learn", *words, "robots.width=[0.2,0.4]", "robot.lidar.noise_std=0") as job:
        return job().config


def driving(config, curriculum=None, robots=3, part=0):
    places = [(list(config.training)[i % 2], 100_000 + i) for i in range(4)]
    choose = lambda first, count: places[:count]  # noqa: E731
    network = network_class(config)()
    run = SimpleNamespace(config=config, network=network, places=choose, device=torch.device("cpu"))
    return Driving(
        run, robots, 4, Reward(2.0, 10.0, -10.0), curriculum or load_settings("learner/ppo").curriculum, part
    )


def test_robots_are_seen_as_their_planner_would_see_them(config):
    made = driving(config)
    made.start(0)
    for _ in range(3):
        found = made.step(torch.tensor([[0.5, 0.2], [1.0, -0.3], [0.2, 0.0]]))
    directions, state = found.features
    views = made._views
    for i in range(3):
        half_length, half_width, _ = views.boxes[i]
        assert directions[i, 0, 3:].numpy() == pytest.approx([half_length, half_length, half_width])
        assert state[i, 0].item() == pytest.approx(math.hypot(*views.targets[i]), abs=FLOAT32_LAYER)
        assert state[i, 2:].numpy() == pytest.approx([*views.twists[i], *views.limits[i]], abs=FLOAT32_LAYER)
        footprint = Footprint(length=2 * half_length, width=2 * half_width)
        own = DclpInterface(
            load_settings("planner/dclp"),
            replace(config.robot, footprint=footprint, v_max=views.limits[i, 0]),
        )
        (observation,) = made._observations(views, [i])
        seen = own.features(observation, views.targets[i])
        np.testing.assert_allclose(directions[i].numpy(), seen.directions, atol=FLOAT32_LAYER)
    assert len(set(views.limits[:, 0])) == 3
    assert views.twists[0, 0] == pytest.approx(0.5 * views.limits[0, 0])


def test_an_easy_stage_is_won_at_a_distance_and_left(config):
    made = driving(
        config,
        load_settings("learner/ppo", curriculum={"within": [9.8], "promote": 0.5}).curriculum,
        robots=20,
    )
    made.start(0)
    rewards = []
    while made.episodes < 100 and len(rewards) < 400:
        rewards.append(made.step(torch.tensor([[1.0, 0.0]] * 20)).rewards)
    assert made.success > 0.5, "ten metres straight ahead, of which 0.2 are enough"
    assert made.promoted
    assert torch.stack(rewards).max() >= 10.0
    assert made.mean_return > 5.0
    made.start(1)
    assert not made.promoted
    assert made._fleet.tasks[0].goal_tolerance == 1.0


def test_another_part_drives_other_episodes(config):
    one, other, again = (driving(config, robots=20, part=part) for part in (0, 1, 0))
    speeds = [made.start(0)[1][:, 4] for made in (one, other, again)]
    torch.testing.assert_close(speeds[0], speeds[2])
    assert not torch.equal(speeds[0], speeds[1])


def test_a_choice_of_a_guide_s_network_lasts_its_period():
    """Robots that arrive within it stand still at their next start until the next choice, and are rewarded once."""
    words = ["guide=learned_subgoal", "planner=simple", "learner=ppo", "training.fresh_hard.subset=fresh"]
    with jobs_of("learn", *words) as job:
        config = job().config
    made = driving(config, load_settings("learner/ppo", curriculum={"within": [9.8]}).curriculum, robots=6)
    made.start(0)
    ahead = torch.full((6,), 2)  # 1.6 m
    found = made.step(ahead)
    assert made._fleet._states.steps.tolist() == [3] * 6, (
        "0.5 s are five periods: two to arrive, three at rest"
    )
    assert len(found.ended) == len(found.last[0]) == made.episodes > 0, "0.2 m are enough"
    assert (made._views.twists[found.ended] == 0.0).all()
    arrived = found.rewards[found.terminated]
    assert ((arrived > 10.0) & (arrived < 11.0)).all()
