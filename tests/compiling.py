"""Compile the kernels once for all workers of pytest-xdist.

In a fresh checkout every worker would compile what its tests call, at the same time as the others and thus the same
kernels. Here each drives some of the guides, planners and simulators, and waits for the rest.
"""

import time
from pathlib import Path

import numpy as np

import lme
from lme.config.presets import load_map_set, load_settings, load_simulator
from lme.gym.fleet import Fleet
from lme.navigation.episode import run_episode
from tests.builders import CLUTTER, shipped, task

DRIVES = {  # keywords of `load_system`; those that compile longest come first
    "min_time": {"guide": "lme_plus", "planner": "min_time"},
    "cloud": {"guide": "target"},
    "learned_subgoal": {"guide": "learned_subgoal"},
    "people": {"guide": "target", "people": "tracked"},
    "teb": {"guide": "target", "planner": "teb"},
    "mppi": {"guide": "global_path", "planner": "mppi"},
    "orca": {"guide": "lme", "planner": "orca"},
    "eband": {"guide": "target", "planner": "eband"},
    "ros_dwa": {"guide": "tangent_bug", "planner": "ros_dwa"},
    "ros_eband": {"guide": "navfn", "planner": "ros_eband"},
    "stopping": {"guide": "target", "filter": "stopping"},
    "skid": {"guide": "target"},
    "lics": {"guide": "target", "planner": "lics"},
    "motion_tubes": {"guide": "target", "planner": "motion_tubes"},
    "dwa": {"guide": "target", "planner": "dwa"},
    "s3_fisvfh": {"guide": "target", "planner": "s3_fisvfh"},
    "apf": {"guide": "target", "planner": "apf"},
    "vfh_plus": {"guide": "target", "planner": "vfh_plus"},
}
FLEETS = {"fleet": ("fast", {}), "delayed_fleet": ("fast", {"latency": 0.1}), "sliding_fleet": ("skid", {})}
_LONGEST_S = 600.0  # to wait for another worker, which may have died


def compile_together(folder: Path) -> None:
    """Take the drives that no other process has taken, and wait until all are done. folder: the processes share it."""
    names = [*DRIVES, *FLEETS]
    for name in names:
        try:
            (folder / f"{name}.taken").touch(exist_ok=False)
        except FileExistsError:
            continue
        if name in FLEETS:
            _drive_together(*FLEETS[name])
        else:
            _drive(name, DRIVES[name])
        (folder / f"{name}.done").touch()
    deadline = time.monotonic() + _LONGEST_S
    while time.monotonic() < deadline and any(not (folder / f"{name}.done").exists() for name in names):
        time.sleep(0.1)


def _drive_together(sim: str, disturbances: dict[str, float]) -> None:
    """Drive robots in a fleet, in worlds with people and without."""
    for maps in (load_map_set("social", {"radius": 0.3, "count": 1}), load_map_set("barn", {"worlds": [0]})):
        fleet = Fleet(maps, shipped("jackal"), 2, load_settings(f"sim/{sim}", **disturbances), people=True)
        fleet.reset([0, 1])
        fleet.step(np.full((2, 2), 0.1))


def _drive(name: str, parts: dict[str, str]) -> None:
    robot = shipped("go2" if name == "cloud" else "jackal")
    simulator_class, config = load_simulator("skid" if name == "skid" else "fast")
    simulator = simulator_class(config, robot)
    navigator = lme.load_system("simple", robot, **parts)
    run_episode(task(CLUTTER, time_limit=1.0), navigator, simulator, np.random.default_rng(0))
