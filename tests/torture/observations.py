"""Absurd observations for every system, in kernels that check every index: `python -m tests.torture observations`.

A failed localisation, odometry or lidar can give any number. What `lme live` and `lme replay` let through must lead to
a finite command or to an InputError; a kernel that left its arrays could do anything.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import traceback
import warnings

import numpy as np

from lme.errors import InputError
from lme.live import goal
from lme.live.poses import FARTHEST, FASTEST
from lme.types import Observation, Pose, Twist
from tests.places import ROOT

_RANGES = np.array([0.0, -1.0, 5e-324, 1e-30, 9.0, 3e38, np.inf, -np.inf, np.nan], dtype=np.float32)
_TARGETS = np.array([0.0, 5e-324, -1e-30, 1e-3, 1e3, goal.FARTHEST, -goal.FARTHEST])
_PLACES = np.array([0.0, 5e-324, -1e-30, 1e-3, 1e3, -1e6, FARTHEST, -FARTHEST])
_FAST = np.array([0.0, 5e-324, -1e-30, 3.0, FASTEST, -FASTEST])
_STEPS = 12
_CHECKED = {"NUMBA_BOUNDSCHECK": "1"}


def absurd(observation: Observation, rng: np.random.Generator) -> Observation:
    """The observation with some of its numbers replaced by ones that no robot has."""
    scan, target = observation.scan, observation.target.copy()
    ranges, twist, pose = scan.ranges.copy(), [*observation.twist], [*observation.odometry]
    lost = rng.random(len(ranges)) < rng.choice([0.0, 0.01, 0.3, 1.0])
    ranges[lost] = rng.choice(_RANGES, lost.sum())
    for numbers, values in ((target, _TARGETS), (twist, _FAST), (pose, _PLACES)):
        for i in range(len(numbers)):
            if rng.random() < 0.3:
                numbers[i] = float(rng.choice(values))
    return observation._replace(
        scan=scan._replace(ranges=ranges), target=target, twist=Twist(*twist), odometry=Pose(*pose)
    )


def drive(words: list[str], drives: int) -> list[str]:
    """Faults of the system of a command line in so many short drives, each with the seed of its drive."""
    from runners.config import build
    from tests.composing import jobs_of

    with jobs_of("eval") as job_of:
        config = job_of(*words, "map=barn", "map.worlds=[0,200]", "tracking=none").config
    maps, faults = build.map_set(config), []
    navigator, simulator = build.navigator(config), build.simulator(config)
    for seed in range(drives):
        rng = np.random.default_rng(seed)
        task = maps.task(maps.numbers[seed % 2])
        navigator.reset(np.random.default_rng(seed))
        navigator.read_map(task.world, task.start)
        observation = simulator.reset(task, np.random.default_rng(seed))
        try:
            for _ in range(_STEPS):
                seen = absurd(observation, rng) if rng.random() < 0.5 else observation
                observation = simulator.step(navigator.act(seen))
        except InputError:
            pass
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            faults.append(f"seed {seed}: {type(error).__name__} at {place.filename}:{place.lineno}: {error}")
    return faults


def report(names: list[str], drives: int) -> int:
    """Drive each system in a process of its own, whose kernels check their indices; the exit status."""
    names = names or sorted(path.stem for path in (ROOT / "conf" / "system").glob("*.yaml"))
    print("| system | short drives | faults |\n|---|---:|---:|")
    faults = 0
    with tempfile.TemporaryDirectory(prefix="torture-") as cache:
        environment = {**os.environ, **_CHECKED, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": str(ROOT)}
        for name in names:
            command = [sys.executable, "-m", __name__, f"system={name}", str(drives)]
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
            found = done.stdout.splitlines()
            if done.returncode:
                found.append(f"died with status {done.returncode}: {done.stderr[-1500:]}")
            print(f"| {name} | {drives} | {len(found)} |", *found, sep="\n  ", flush=True)
            faults += len(found)
    return int(faults > 0)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for fault in drive([sys.argv[1]], int(sys.argv[2])):
        print(fault)
