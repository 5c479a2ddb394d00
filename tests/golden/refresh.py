"""Episodes on record: each JSON holds its own config, what came of it, and why it came to be so.

`python -m tests.golden.refresh` drives them all again, shows what differs, asks why, and writes it down.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from lme.config.presets import load_settings
from lme.guides.lme.guide import Lme
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Pose
from lme.worlds.barn.map_set import Barn
from lme.worlds.world import World
from tests.builders import robot_from, task

FOLDER = Path(__file__).parent
EVERY = 10  # rows of the trajectory: enough to see where two runs part, and the file stays small


def play(config):
    """Drive the episode of one golden file: what to put on record."""
    robot = robot_from(config["robot"])
    navigator = Navigator(
        _guide(config["guide"], robot), Simple(load_settings("planner/simple", **config["planner"]), robot)
    )
    simulator = FastSimulator(load_settings("sim/fast", **config["sim"]), robot)
    episode = run_episode(_task(config), navigator, simulator, np.random.default_rng(config["seed"]))
    return {
        "outcome": str(episode.outcome),
        "steps": episode.steps,
        "switches": episode.switches,
        "no_free_candidate": episode.no_free_candidate,
        "time_s": episode.time,
        "path_length_m": episode.path_length,
        "min_clearance_m": episode.min_clearance,
        "trajectory": [
            [round(value, 9) for value in row[:8]] for row in episode.trajectory[:-1:EVERY].tolist()
        ],
    }


def _guide(config, robot):
    if config is None:
        return Target(TargetConfig(), robot)
    return Lme(load_settings("guide/lme", **config), robot)


def _task(config):
    world = config["world"]
    if "barn" in world:
        return Barn(load_settings("map/barn", worlds=[world["barn"]], time_limit=config["time_limit"])).task(
            world["barn"]
        )
    shapes = {
        "circles": np.array(world["circles"], dtype=float).reshape(-1, 3),
        "segments": np.array(world["segments"], dtype=float).reshape(-1, 4),
    }
    start, goal = Pose(*config["start"]), config["goal"]
    return task(World(**shapes), start, goal, config["goal_tolerance"], config["time_limit"])


def differences(recorded, now):
    """One line for each part that is not as recorded: counts and words exactly, numbers to 1 µm."""
    return [
        f"{key}: {_short(recorded.get(key))} on record, {_short(value)} now"
        for key, value in now.items()
        if not _same(recorded.get(key), value)
    ]


def _same(recorded, now):
    if isinstance(now, list):
        alike = isinstance(recorded, list) and np.shape(recorded) == np.shape(now)
        return alike and np.allclose(recorded, now, rtol=0.0, atol=1e-6)
    if isinstance(now, float) and recorded is not None:
        return bool(np.isclose(recorded, now, rtol=0.0, atol=1e-6))
    return recorded == now


def _short(value):
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


def main():
    """Refresh what differs, for a reason."""
    for path in sorted(FOLDER.glob("*.json")):
        golden = json.loads(path.read_text("utf-8"))
        now = play(golden["config"])
        lines = differences(golden.get("result", {}), now)
        if not lines:
            continue
        print(path.name, *lines, sep="\n  ")
        why = input("Why is the new result right? (nothing: leave the record as it is) ").strip()
        if not why:
            continue
        golden["why"] = [*golden.get("why", []), why]
        golden["result"] = now
        path.write_text(_pretty(golden), "utf-8")
    return 0


def _pretty(golden):
    """Indented, with the trajectory a row a line."""
    rows = ",\n".join(f"      {json.dumps(row)}" for row in golden["result"]["trajectory"])
    golden = {**golden, "result": {**golden["result"], "trajectory": "ROWS"}}
    text = json.dumps(golden, indent=2, ensure_ascii=False)
    return text.replace('"ROWS"', f"[\n{rows}\n    ]") + "\n"


if __name__ == "__main__":
    sys.exit(main())
