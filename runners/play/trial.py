"""Trials of words in a process of their own before a session adopts them, since no step may take minutes.

A value such as a cell size of one micrometre would fill the memory or compute for hours, and nothing could interrupt
that in the process of the page. The values that its sliders set have limits instead and need no trial.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from multiprocessing.connection import Connection

from lme.errors import InputError
from runners.play.session import Session, Source
from runners.play.setups import setup_of
from runners.workers import forkserver

START_S, LONGEST_S = 120.0, 20.0  # time limits for the start of the process and for the first steps
STEPS = 3
MOST_BYTES = 8 * 2**30  # of address space

# Least and greatest values that the page sets without a trial.
LIMITS: Mapping[str, tuple[float, float]] = {
    "robot.v_max": (0.0, 20.0),
    "robot.omega_max": (0.0, 50.0),
    "robot.alpha_v": (0.0, 100.0),
    "robot.alpha_omega": (0.0, 100.0),
    "robot.control_rate": (1.0, 200.0),
    "robot.lidar.num_beams": (2.0, 5000.0),
    "robot.lidar.fov": (0.0, 7.0),
    "robot.lidar.range_max": (0.0, 500.0),
    "robot.lidar.noise_std": (0.0, 10.0),
    "sim.latency": (0.0, 5.0),
    "sim.lag": (0.0, 10.0),
    "sim.slip": (0.0, 10.0),
    "sim.odometry_error": (0.0, 10.0),
    "sim.scan_noise": (0.0, 10.0),
    "sim.scan_dropout": (0.0, 1.0),
    "sim.goal_noise": (0.0, 100.0),
    "sim.goal_noise_yaw": (0.0, 10.0),
    "scale": (-1000.0, 1000.0),
}
_HARMLESS = ("map.worlds", "seed", "run")
_NUMBER = re.compile(
    r"(?<![\w.])[+-]?(?:inf|nan|(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:e[+-]?\d[\d_]*)?)(?!\w)", re.IGNORECASE
)


def try_words(source: Source, changes: Mapping[str, object]) -> None:
    """Raise InputError unless words drive their first steps in reasonable time and memory.

    source: has the changed words. changes: made to the words; changes of names alone need no trial.
    """
    # Values within the limits of the sliders are harmless; any other number makes a trial necessary.
    numbers = {
        key: [float(number.replace("_", "")) for number in _NUMBER.findall(str(value))]
        for key, value in changes.items()
        if key not in _HARMLESS
    }
    for key, (lowest, highest) in LIMITS.items():
        for number in numbers.pop(key, []):
            if not lowest <= number <= highest:
                raise InputError(f"{key} is {number:g}: lme play takes {lowest:g} to {highest:g}")
    if any(numbers.values()):
        _try(source)


def _try(source: Source) -> None:
    with forkserver.context() as context:
        parent, child = context.Pipe()
        process = context.Process(target=_drive, args=(child, source), daemon=True)
        process.start()
        child.close()
    # Wait for the process, then for the first steps. It is killed in any case.
    try:
        problem = (
            parent.recv() if parent.poll(START_S) and parent.recv() and parent.poll(LONGEST_S) else _TOO_LONG
        )
    except EOFError:
        problem = "these words end the process that drives them, perhaps for want of memory"
    finally:
        process.kill()
        process.join()
    if problem:
        raise InputError(problem)


_TOO_LONG = f"these words need more than {LONGEST_S:g} s for the first {STEPS} steps: choose values nearer to the usual"


def _drive(page: Connection, source: Source) -> None:
    """Report that the process has started, then what prevents driving; "" if nothing does."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    page.send("there")
    try:
        Session(setup_of(source)).advance(STEPS, LONGEST_S)
    except InputError as error:
        page.send(str(error))
    except Exception as error:
        page.send(f"{type(error).__name__}: {error}")
    else:
        page.send("")
