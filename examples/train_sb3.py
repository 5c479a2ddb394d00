"""Learn to drive in BARN worlds with PPO of Stable-Baselines3: ten minutes on one core, or as many as you choose.

    pip install stable-baselines3
    python train_sb3.py [MINUTES]

It trains 64 robots in fresh worlds, then drives the learned policy through fifty other fresh worlds. barn_ppo.onnx is
the policy for planner=onnx (docs/howto/environments.md).
"""

import sys
import time
import warnings
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

try:
    import gymnasium as gym
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    sys.exit(f"train_sb3.py needs {error.name}: pip install stable-baselines3")

import lme
from lme.gym import FlatObservation, flattened

BEAMS = 72
TASK: dict[str, Any] = {
    "robot": replace(
        lme.load_robot("jackal"), alpha_v=3.0, alpha_omega=15.0
    ),  # as fast as wheels without slip allow
    "reward": {"progress": 0.5, "success": 5.0, "collision": -5.0, "step": -0.02},
}


class ManyRobots(VecEnv):
    """Gymnasium's vector environment as Stable-Baselines3 wants it, with the flat observation."""

    def __init__(self, envs: Any) -> None:
        self.envs, self.actions = envs, np.zeros((envs.num_envs, 2), dtype=np.float32)
        space = gym.spaces.Box(-1.0, 1.0, (BEAMS + 4,), np.float32)
        super().__init__(envs.num_envs, space, envs.single_action_space)

    def reset(self) -> Any:
        self.actions[:] = 0.0
        return flattened(self.envs.reset(seed=self._seeds)[0], self.actions, BEAMS)

    def step_async(self, actions: Any) -> None:
        self.actions = np.clip(actions, -1.0, 1.0)

    def step_wait(self) -> Any:
        seen, rewards, terminated, truncated, infos = self.envs.step(self.actions)
        done = terminated | truncated
        each: list[dict[str, Any]] = [{} for _ in done]
        for i in np.flatnonzero(done):
            last = flattened(infos["final_obs"][i], self.actions[i], BEAMS)
            each[i] = {"terminal_observation": last, "TimeLimit.truncated": bool(truncated[i])}
            each[i]["is_success"] = bool(infos["final_info"]["is_success"][i])
        self.actions[done] = 0.0
        return flattened(seen, self.actions, BEAMS), rewards, done, each

    def close(self) -> None:
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.envs, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError("the robots share one environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **keywords: Any) -> list[Any]:
        raise NotImplementedError("the robots share one environment")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


class Clock(BaseCallback):
    """Stops after some seconds of training, and prints the share of arrivals among the last 500 episodes."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.end, self.last = time.monotonic() + seconds, deque[bool](maxlen=500)

    def _on_step(self) -> bool:
        self.last.extend(info["is_success"] for info in self.locals["infos"] if info)
        return time.monotonic() < self.end

    def _on_rollout_end(self) -> None:
        rate = sum(self.last) / max(len(self.last), 1)
        print(f"{self.num_timesteps:8d} steps: {rate:.2f} of the last {len(self.last)} episodes succeeded")


def worlds(fresh_seed: int, count: int) -> dict[str, Any]:
    """Keys of conf/map/barn.yaml: fresh worlds, with 30 s to get through instead of 100."""
    return {"subset": "fresh", "fresh_seed": fresh_seed, "count": count, "time_limit": 30.0}


def learn(minutes: float) -> PPO:
    """A policy trained in 200 fresh worlds."""
    envs = ManyRobots(gym.make_vec("lme:lme/Barn-v0", num_envs=64, map_config=worlds(0, 200), **TASK))
    envs.seed(0)
    network = {"net_arch": [256, 256], "log_std_init": -0.5}
    model = PPO("MlpPolicy", envs, n_steps=128, batch_size=1024, policy_kwargs=network, seed=0, device="cpu")
    return model.learn(total_timesteps=10**9, callback=Clock(60.0 * minutes))


def drive(model: PPO) -> dict[str, int]:
    """How often the policy arrives, collides and runs out of time in fifty other fresh worlds."""
    env = FlatObservation(gym.make("lme:lme/Barn-v0", map_config=worlds(1, 50), **TASK), beams=BEAMS)
    outcomes: dict[str, int] = {}
    for world in range(1000, 1050):
        observation, _ = env.reset(seed=world, options={"world": world})
        info: dict[str, Any] = {}
        while "outcome" not in info:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, _, _, info = env.step(action)
        outcomes[info["outcome"]] = outcomes.get(info["outcome"], 0) + 1
    return outcomes


class Actor(torch.nn.Module):
    """The mean of the actions, as `predict(observation, deterministic=True)` gives it before it cuts them off at ±1."""

    def __init__(self, model: PPO) -> None:
        super().__init__()
        self.policy = model.policy

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.policy(observation, deterministic=True)[0]


def export(model: PPO, path: str) -> None:
    """Write the policy as an ONNX file that maps (1, beams + 4) to (1, 2)."""
    seen = torch.zeros(1, BEAMS + 4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter that needs no further package is an old one
        torch.onnx.export(Actor(model), (seen,), path, input_names=["observation"], dynamo=False)


def main(minutes: float) -> None:
    torch.set_num_threads(1)
    model = learn(minutes)
    model.save("barn_ppo")
    export(model, "barn_ppo.onnx")
    print(drive(model))


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
