"""Divides the time of a closed-loop step into that of each kernel that Python calls, and the Python between them."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import wraps
from itertools import pairwise
from typing import Any
from unittest.mock import patch

import numpy as np
from numba.core.dispatcher import Dispatcher

from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.simulation.simulator import Simulator
from lme.worlds.world import MapSet

_RUNS = 5  # the fastest counts


def step_rows(maps: MapSet, navigator: Navigator, simulator: Simulator) -> Iterator[str]:
    """Yield rows of a Markdown table: µs per step, share of the step, calls per step."""
    _drive(maps, navigator, simulator)  # compiles
    step = min(_drive(maps, navigator, simulator) for _ in range(_RUNS))
    yield f"| whole step | {step:.1f} | | |"
    ((decision, _),) = _time_per_method([(navigator, "act")], maps, navigator, simulator).values()
    yield f"| of it the decision | {decision:.1f} | {decision / step:.0%} | 1 |"
    kernels = _time_per_method(_kernels(), maps, navigator, simulator)
    for name, (spent, calls) in sorted(kernels.items(), key=lambda kernel: -kernel[1][0]):
        yield f"| `{name}` | {spent:.1f} | {spent / step:.0%} | {calls:.2g} |"
    between = step - sum(spent for spent, _ in kernels.values())
    calls = sum(calls for _, calls in kernels.values())
    yield f"| Python and numpy between the kernels | {between:.1f} | {between / step:.0%} | {calls:.2g} |"


def _drive(maps: MapSet, navigator: Navigator, simulator: Simulator) -> float:
    """Processor time of a step [µs], over every fifth task."""
    tasks = [maps.task(number) for number in maps.numbers[::5]]
    start = time.thread_time_ns()
    episodes = [run_episode(task, navigator, simulator, np.random.default_rng(1)) for task in tasks]
    return (time.thread_time_ns() - start) / 1e3 / sum(episode.steps for episode in episodes)


def _time_per_method(
    methods: list[tuple[Any, str]], maps: MapSet, navigator: Navigator, simulator: Simulator
) -> dict[str, tuple[float, float]]:
    """Processor time [µs] and calls per step of the functions that are found in these places."""
    times: dict[str, list[int]] = {}
    best, least = {}, float("inf")
    with ExitStack() as patches:
        for owner, name in [*methods, (simulator, "step")]:
            patches.enter_context(patch.object(owner, name, _timed(getattr(owner, name), times)))
        for _ in range(_RUNS):
            times.clear()
            step = _drive(maps, navigator, simulator)
            steps = len(times.pop("step"))
            if step < least:
                least = step
                best = {name: (sum(spent) / 1e3 / steps, len(spent) / steps) for name, spent in times.items()}
    return best


def _kernels() -> list[tuple[Any, str]]:
    """The places in lme's modules where Python finds a kernel; kernels find each other when they are compiled."""
    modules = [module for name, module in sys.modules.items() if name.startswith("lme.")]
    return [
        (module, name)
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, Dispatcher)
    ]


def _timed(function: Callable[..., Any], times: dict[str, list[int]]) -> Callable[..., Any]:
    """The function; it also notes the processor time of each call [ns], without that of reading the clock."""
    name = function.__name__

    @wraps(function)
    def timed(*args: Any) -> Any:
        start = time.thread_time_ns()
        result = function(*args)
        times.setdefault(name, []).append(time.thread_time_ns() - start - _CLOCK_NS)
        return result

    return timed


def _clock_ns() -> int:
    """Least time between two readings of the clock."""
    readings = [time.thread_time_ns() for _ in range(1000)]
    return min(after - before for before, after in pairwise(readings))


_CLOCK_NS = _clock_ns()
