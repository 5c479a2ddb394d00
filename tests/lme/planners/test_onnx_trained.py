"""A policy that was trained in lme.gym drives as planner=onnx as it did there."""

import numpy as np
import pytest

import lme
from lme.config.presets import load_map_set

torch = pytest.importorskip("torch")
gym = pytest.importorskip("gymnasium")
pytest.importorskip("onnxruntime")
from lme.gym import FlatObservation, flattened  # noqa: E402

BEAMS, WORLDS = 72, {"subset": "fresh", "count": 4, "time_limit": 10.0}
LOOK = {
    "planner.inputs": ["scan", "target", "action"],
    "planner.scan.beams": BEAMS,
    "planner.scan.clip": 5.0,
    "planner.scan.scaled": [-1.0, 1.0],
    "planner.target.reach": 10.0,
}
STEPS, ROBOTS = 8, 4
POSES = 1e-3  # [m, rad] torch and onnxruntime round differently


@pytest.fixture(scope="module")
def policy():
    """An actor after some steps of REINFORCE with 4 robots in fresh BARN worlds; they change its weights."""
    torch.manual_seed(0)
    actor = torch.nn.Sequential(torch.nn.Linear(BEAMS + 4, 16), torch.nn.Tanh(), torch.nn.Linear(16, 2))
    before = actor[0].weight.detach().clone()
    optimizer = torch.optim.Adam(actor.parameters(), 0.01)
    envs = gym.make_vec("lme:lme/Barn-v0", num_envs=ROBOTS, robot="jackal", map_config=WORLDS)
    observations, action = envs.reset(seed=0)[0], np.zeros((ROBOTS, 2))
    for _ in range(3):
        losses = []
        for _ in range(STEPS):
            flat = torch.from_numpy(flattened(observations, action, BEAMS))
            normal = torch.distributions.Normal(actor(flat), 0.5)
            drawn = normal.sample()
            action = np.clip(drawn.numpy(), -1.0, 1.0)
            observations, rewards, *_ = envs.step(action)
            losses.append(-(normal.log_prob(drawn).sum(1) * torch.from_numpy(rewards)).mean())
        optimizer.zero_grad()
        torch.stack(losses).sum().backward()
        optimizer.step()
    envs.close()
    assert not torch.equal(before, actor[0].weight)
    return actor


@pytest.fixture(scope="module")
def file(policy, tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "policy.onnx"
    with pytest.warns(DeprecationWarning, match="legacy"):  # the exporter that needs no further package
        torch.onnx.export(policy, (torch.zeros(1, BEAMS + 4),), str(path), dynamo=False)
    return path


@pytest.fixture
def robot():
    """A Jackal whose lidar does not err, so that no random number is drawn."""
    made = lme.load_robot("jackal")
    made.lidar.noise_std = 0.0
    return made


def driven_in_the_environment(policy, robot, world):
    """Poses (T, 3) with the policy in PyTorch, and the outcome."""
    env = FlatObservation(gym.make("lme:lme/Barn-v0", robot=robot, map_config=WORLDS), beams=BEAMS)
    observation, _ = env.reset(seed=7, options={"world": world})
    info, simulator, poses = {}, env.unwrapped._simulator, []
    while "outcome" not in info:
        poses.append(simulator.state.pose)
        with torch.no_grad():
            action = policy(torch.from_numpy(observation)[None])[0].numpy()
        observation, _, _, _, info = env.step(action)
    return np.array(poses), info["outcome"]


@pytest.mark.parametrize("place", [0, 3])
def test_it_drives_as_in_the_environment(policy, file, robot, place):
    maps = load_map_set("barn", WORLDS)
    world = list(maps.numbers)[place]
    navigator = lme.load_system("simple", robot, planner="onnx", **{"planner.path": str(file), **LOOK})
    simulator = lme.FastSimulator(lme.load_settings("sim/fast"), robot)
    episode = lme.run_episode(maps.task(world), navigator, simulator, np.random.default_rng(0))
    poses, outcome = driven_in_the_environment(policy, robot, world)
    assert episode.outcome == outcome
    away = episode.trajectory[: len(poses), 1:4] - poses
    away[:, 2] = np.angle(np.exp(1j * away[:, 2]))  # a record's yaw lies in (−π, π]
    np.testing.assert_allclose(away, 0.0, atol=POSES)
