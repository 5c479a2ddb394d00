"""Twist and target of many robots as encoders and localisation measure them."""

import math
from typing import NamedTuple

from numba import njit

from lme.gym.kernels.poses import between, compose, relative, to_robot, to_world
from lme.types import Floats, Ints


class Estimates(NamedTuple):
    """What N robots have measured so far.

    scales (N, 2): errors of speed and turn rate, as factors. exact, measured (N, 3): odometry without and with them.
    motions (N, Q, 9): rings of the past, with time, pose, twist and odometry; first, counts (N,): the oldest of them
    and how many there are. fixes (N, 2), dues (N,): the goal in the odometry frame [m], and when localisation sees it
    again [s].
    """

    scales: Floats
    exact: Floats
    measured: Floats
    motions: Floats
    first: Ints
    counts: Ints
    fixes: Floats
    dues: Floats


@njit(cache=True, error_model="numpy", nogil=True)
def measure(chosen, states, goals, encoders, sways, pose_errors, is_due, estimates, rules, targets, twists):
    """Write targets (N, 2) and twists (N, 2) of the chosen robots (K,) as encoders and localisation measure them.

    sways (N, 2) of the gait [m/s, rad/s]; pose_errors (N, 3) of localisation; is_due (N,): it sees the goal now. rules:
    whether odometry has errors, whether the goal is known exactly, age of the motion [s], rate of localisation [Hz].
    """
    has_errors, is_exact, age, rate = rules
    for i in chosen:
        time = states.times[i]
        pose = (states.poses[i, 0], states.poses[i, 1], states.poses[i, 2])
        twist = (encoders.twists[i, 0] + sways[i, 0], encoders.twists[i, 1] + sways[i, 1])
        odometry = (encoders.odometry[i, 0], encoders.odometry[i, 1], encoders.odometry[i, 2])
        # Twist and odometry with the errors of the encoders, then those of some time ago.
        if has_errors:
            twist, odometry = _with_errors(i, twist, odometry, estimates)
        if age > 0.0:
            pose, twist, odometry = _past(i, time, age, pose, twist, odometry, estimates.motions, estimates)
        twists[i, 0], twists[i, 1] = twist
        # The goal as localisation sees it, moved on by odometry.
        if is_exact:
            targets[i, 0], targets[i, 1] = to_robot(goals[i, 0], goals[i, 1], pose)
            continue
        if is_due[i]:
            error = pose_errors[i]
            estimate = (pose[0] + error[0], pose[1] + error[1], pose[2] + error[2])
            x, y = to_robot(goals[i, 0], goals[i, 1], estimate)
            estimates.fixes[i, 0], estimates.fixes[i, 1] = to_world(x, y, odometry)
            estimates.dues[i] = (math.floor(time * rate + 1e-9) + 1) / rate if rate > 0.0 else math.inf
        targets[i, 0], targets[i, 1] = to_robot(estimates.fixes[i, 0], estimates.fixes[i, 1], odometry)


@njit(cache=True, error_model="numpy")
def _with_errors(i, twist, odometry, estimates):
    """Twist and odometry of robot i as measured, as `Odometry.measured` returns them."""
    scale_v, scale_omega = estimates.scales[i, 0], estimates.scales[i, 1]
    exact, measured = estimates.exact[i], estimates.measured[i]
    x, y, yaw = relative(odometry, (exact[0], exact[1], exact[2]))
    turn = scale_omega * yaw
    x, y = to_world(x, y, (0.0, 0.0, (turn - yaw) / 2))
    moved = compose((measured[0], measured[1], measured[2]), (scale_v * x, scale_v * y, turn))
    exact[0], exact[1], exact[2] = odometry
    measured[0], measured[1], measured[2] = moved
    return (scale_v * twist[0], scale_omega * twist[1]), moved


@njit(cache=True, error_model="numpy")
def _past(i, time, age, pose, twist, odometry, motions, estimates):
    """Pose, twist and odometry of robot i `age` [s] ago, as `PastMotion.at` returns them."""
    ring, size = motions[i], motions.shape[1]
    newest = ring[(estimates.first[i] + estimates.counts[i]) % size]
    newest[0] = time
    newest[1], newest[2], newest[3] = pose
    newest[4], newest[5] = twist
    newest[6], newest[7], newest[8] = odometry
    estimates.counts[i] += 1
    while estimates.counts[i] > 1 and ring[(estimates.first[i] + 1) % size, 0] <= time - age:
        estimates.first[i] = (estimates.first[i] + 1) % size
        estimates.counts[i] -= 1
    # Interpolate between the last motion up to then and the one after it.
    a = ring[estimates.first[i]]
    b = ring[(estimates.first[i] + min(1, estimates.counts[i] - 1)) % size]
    fraction = max(time - age - a[0], 0.0) / (b[0] - a[0]) if b[0] > a[0] else 0.0
    return (
        between((a[1], a[2], a[3]), (b[1], b[2], b[3]), fraction),
        (a[4] + fraction * (b[4] - a[4]), a[5] + fraction * (b[5] - a[5])),
        between((a[6], a[7], a[8]), (b[6], b[7], b[8]), fraction),
    )
