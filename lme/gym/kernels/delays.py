"""Commands of many robots on the way to their wheels: latency, and the response of legs."""

from typing import NamedTuple

from numba import njit

from lme.simulation.gait import respond
from lme.types import Floats, Ints


class Queues(NamedTuple):
    """Commands on their way to the wheels of N robots: rings of Q times (N, Q) and commands (N, Q, 2).

    first, counts (N,): the next one and how many there are. arrived (N, 2): the last one that has arrived.
    """

    times: Floats
    commands: Floats
    first: Ints
    counts: Ints
    arrived: Floats


class Gaits(NamedTuple):
    """Responses of N robots, of v and of ω: twists (N, 2), y'/f (N, 2), transitions (N, 2, 3, 3); is_followed (2,)."""

    twists: Floats
    rates: Floats
    transitions: Floats
    is_followed: Floats


@njit(cache=True, error_model="numpy")
def send(queues, i, time, v, omega):
    """Queue a command of robot i that arrives at `time` [s]."""
    slot = (queues.first[i] + queues.counts[i]) % queues.times.shape[1]
    queues.times[i, slot] = time
    queues.commands[i, slot, 0], queues.commands[i, slot, 1] = v, omega
    queues.counts[i] += 1


@njit(cache=True, error_model="numpy")
def remember(last, command, limits, dt):
    """Move the last command towards the next one, as far as the limits allow in `dt` [s]: `lme.robots.reachable`."""
    for axis in range(2):
        goal, change = min(max(command[axis], -limits[axis]), limits[axis]), limits[axis + 2] * dt
        last[axis] = min(max(goal, last[axis] - change), last[axis] + change)


@njit(cache=True, error_model="numpy")
def receive(queues, i, time):
    """Let the commands of robot i arrive that are due by `time` [s]; return whether there are any."""
    count = queues.counts[i]
    while queues.counts[i] > 0 and queues.times[i, queues.first[i]] <= time:
        queues.arrived[i] = queues.commands[i, queues.first[i]]
        queues.first[i] = (queues.first[i] + 1) % queues.times.shape[1]
        queues.counts[i] -= 1
    return queues.counts[i] < count


@njit(cache=True, error_model="numpy")
def walk(gaits, i, v, omega, dt):
    """Distance [m] and turn [rad] in `dt` [s] of legs that follow a command, as `GaitResponse.follow` returns them."""
    motion, command = (0.0, 0.0), (v, omega)
    for axis in range(2):
        moved, reached = command[axis] * dt, command[axis]
        if gaits.is_followed[axis] > 0.0:
            y, rate = gaits.twists[i, axis], gaits.rates[i, axis]
            moved, reached, gaits.rates[i, axis] = respond(gaits.transitions[i, axis], y, rate, command[axis])
        gaits.twists[i, axis] = reached
        motion = (moved, 0.0) if axis == 0 else (motion[0], moved)
    return motion


@njit(cache=True, error_model="numpy")
def has_gait(gaits):
    """Return whether legs follow the command."""
    return gaits.is_followed[0] > 0.0 or gaits.is_followed[1] > 0.0
