"""Measures the environments: steps per second of many robots in one call, of one robot, and of a row of single ones.

    python -m benchmarks.envs [--record]

They take turns on one core, so ratios are valid on a busy machine too. Time is the processor time of this process.
--record also writes benchmarks/results/envs.md.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.presets import load_map_set, load_robot
from lme.robots import Robot
from lme.worlds.world import Task

Settings = Mapping[str, Any]

ENVS, ROUNDS, STEPS = 64, 15, 25  # steps: of every robot, per round
STAGE, JACKAL = load_robot("stage"), load_robot("jackal")
NOISY = replace(JACKAL, lidar=replace(JACKAL.lidar, num_beams=540))
SCENES: dict[str, tuple[Robot, str, Settings]] = {
    "`stage`, Env1": (STAGE, "env1", {"radius": 0.2}),
    "`stage`, 50 sparse BARN worlds": (STAGE, "barn", {"worlds": list(range(50))}),
    "`stage`, `official50`": (STAGE, "barn", {"subset": "official50"}),
    "`jackal` with 540 noisy beams, `official50`": (NOISY, "barn", {"subset": "official50"}),
}
WORLDS: dict[str, tuple[str, Settings]] = {
    "BARN, official": ("barn", {"subset": "official50"}),
    "BARN, fresh": ("barn", {"subset": "fresh", "count": 120, "fresh_seed": 5}),
    "Env1": ("env1", {"radius": 0.2}),
}


class Built:
    """A map set whose worlds are built already, so that 64 environments need not build them 64 times."""

    def __init__(self, name: str, settings: Settings) -> None:
        maps = load_map_set(name, settings)
        self.tasks = {number: maps.task(number) for number in maps.numbers}
        self.numbers = maps.numbers

    def task(self, number: int) -> Task:
        return self.tasks[number]


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "envs", parser(__doc__, "envs").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Speed of the environments\n"
    yield f"`python -m benchmarks.envs --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield "Steps of a robot per second of processor time on one core, 540 beams, resets included, worlds built: median"
    yield f"and best of {ROUNDS} rounds. One call moves {ENVS} robots; `SyncVectorEnv` holds as many.\n"
    yield "| scene | one call | best | one robot | best | `SyncVectorEnv` | best | × one robot | × `SyncVectorEnv` |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    for name, (robot, map_name, settings) in SCENES.items():
        rates = measured({"robot": robot, "map": Built(map_name, settings)})
        median, best = np.median(rates, axis=0), rates.max(axis=0)
        cells = " | ".join(f"{m:,.0f} | {b:,.0f}" for m, b in zip(median, best, strict=True))
        yield f"| {name} | {cells} | {median[0] / median[1]:.1f} | {median[0] / median[2]:.1f} |"
    yield "\n## Building a world\n"
    yield "| worlds | median [ms] | mean [ms] | slowest [ms] |"
    yield "|---|---:|---:|---:|"
    for name, (map_name, settings) in WORLDS.items():
        times = building(map_name, settings)
        yield f"| {name} | {np.median(times):.1f} | {np.mean(times):.1f} | {np.max(times):.1f} |"


def measured(keywords: dict[str, Any]) -> Any:
    """(ROUNDS, 3) steps per second in one call, of one robot, and of a SyncVectorEnv."""
    env_id = "lme:lme/Barn-v0"
    vector_env: Any = gym.make_vec(env_id, ENVS, **keywords)
    single_env: Any = gym.make(env_id, **keywords).unwrapped
    sync: Any = gym.make_vec(env_id, ENVS, "sync", **keywords)
    for env in (vector_env, single_env, sync):
        for world in keywords["map"].numbers:  # builds and checks each
            env.reset(seed=0, options={"world": world})
        env.reset(seed=0)
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(ROUNDS + 1):
        actions = rng.uniform([0.0, -0.5], [1.0, 0.5], (STEPS, ENVS, 2))
        methods = ((together, vector_env), (alone, single_env), (together, sync))
        rows.append([rate(drive, env, actions) for drive, env in methods])
    return np.array(rows[1:])


def rate(drive: Callable[[Any, Any], None], env: Any, actions: Any) -> float:
    """Steps of a robot per second."""
    start = time.process_time()
    drive(env, actions)
    return STEPS * ENVS / (time.process_time() - start)


def together(envs: Any, actions: Any) -> None:
    """Drive all robots."""
    for commands in actions:
        envs.step(commands)


def alone(env: Any, actions: Any) -> None:
    """Drive one robot as often."""
    for action in actions.reshape(-1, 2):
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()


def building(name: str, settings: Settings) -> list[float]:
    """Time to build each world [ms]."""
    maps, times = load_map_set(name, settings), []
    for number in maps.numbers:
        start = time.process_time()
        maps.task(number)
        times.append(1e3 * (time.process_time() - start))
    return times


if __name__ == "__main__":
    run_main(main)
