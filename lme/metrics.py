"""Metrics of one episode and of many: the paper's, and SPL, smoothness and intervals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lme.errors import InputError
from lme.types import Outcome

Z_95 = 1.959963984540054  # two-sided 95 % quantile of the standard normal
REVERSE_MPS = 0.05  # [m/s] a robot that moves backwards faster than this backs up; slower, it only settles


def barn_metric(success: bool, time_s: float, optimal_time_s: float) -> float:
    """BARN metric, I(success) · OT / clip(AT, 2 OT, 8 OT): 0 on failure, else from 1/8 (slow) to 1/2 (fast).

    time_s: actual traversal time AT [s]. optimal_time_s: OT [s]; if it is NaN, the metric of a success is NaN.
    Raises InputError if OT is not positive. Paper §IV.B.
    """
    if optimal_time_s <= 0:
        raise InputError(f"optimal_time_s is {optimal_time_s:g}: must be greater than 0")
    if not success:
        return 0.0
    return float(optimal_time_s / np.clip(time_s, 2 * optimal_time_s, 8 * optimal_time_s))


def spl(success: bool, shortest_m: float, path_m: float) -> float:
    """Success weighted by path length: I(success) · shortest / max(path, shortest), in [0, 1].

    shortest_m: length of the shortest path [m]; path_m: length driven [m].
    A success is 1 if both lengths are 0. Anderson et al. 2018, arXiv 1807.06757.
    """
    if not success:
        return 0.0
    longest = max(path_m, shortest_m)
    return shortest_m / longest if longest > 0 else 1.0


def mean_abs_domega(omega: ArrayLike) -> float:
    """Smoothness: mean |Δω| between consecutive control steps; lower is smoother.

    omega: (T,) turn rate at each step and at the end of the episode [rad/s]. The mean has the same unit.
    0 for an episode without a step.
    """
    changes = np.abs(np.diff(np.asarray(omega, dtype=np.float64)))
    return float(changes.mean()) if changes.size else 0.0


def last_extent(time: ArrayLike, positions: ArrayLike, seconds: float = 60.0) -> float:
    """Diagonal of the box around the positions of the last `seconds` [m]: small for a robot that is stuck.

    time: (T,) increasing [s]. positions: (T, 2) [m]. 0 for an episode without a position.
    """
    time, positions = np.asarray(time, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    if not time.size:
        return 0.0
    return float(np.hypot(*np.ptp(positions[time >= time[-1] - seconds], axis=0)))


def reverse_starts(v: ArrayLike) -> int:
    """Number of times that the robot begins to back up: its speed falls below −`REVERSE_MPS`.

    v: (T,) forward speed [m/s].
    """
    backing = np.asarray(v, dtype=np.float64) < -REVERSE_MPS
    return int(np.count_nonzero(backing[1:] & ~backing[:-1]))


def reward(outcome: Outcome | str, steps: int, max_steps: int, crash: float, timeout: float) -> float:
    """Reward R of an episode: 1 − L/L_max on success, else the penalty R_c or R_t (paper eq. 1).

    steps, max_steps: L and L_max. crash, timeout: R_c and R_t, negative (in the paper's example −0.2).
    Raises InputError for any other outcome, and for a max_steps below 1.
    """
    if max_steps < 1:
        raise InputError(f"max_steps is {max_steps}: must be at least 1")
    if outcome == Outcome.SUCCESS:
        return 1.0 - steps / max_steps
    penalties: dict[str, float] = {Outcome.COLLISION: crash, Outcome.TIMEOUT: timeout}
    if outcome not in penalties:
        raise InputError(f"outcome is {outcome!r}: must be one of {', '.join(Outcome)}")
    return penalties[outcome]


def wilson_interval(successes: float, n: float, z: float = Z_95) -> tuple[float, float]:
    """Wilson's confidence interval of a proportion: (low, high) in [0, 1]; (0, 1) if n is 0.

    z: quantile of the standard normal; the default gives 95 %. An effective number of trials need not be whole.
    Raises InputError unless 0 ≤ successes ≤ n.
    Wilson 1927, DOI 10.1080/01621459.1927.10502953.
    """
    if not 0 <= successes <= n:
        raise InputError(f"successes is {successes} of n = {n}: must lie between 0 and n")
    if n == 0:
        return 0.0, 1.0
    # scipy.stats.binomtest(successes, n).proportion_ci(method="wilson") is the same; its import takes a second.
    # Bounds: (p + z²/2n ± z √(p (1 − p)/n + z²/4n²)) / (1 + z²/n).
    rate, shift = successes / n, z * z / n
    centre = (rate + shift / 2) / (1 + shift)
    half = z * math.sqrt(rate * (1 - rate) / n + shift / (4 * n)) / (1 + shift)
    # The low bound of 0 successes is exactly 0, the high bound of n exactly 1; rounding must not change that.
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == n else min(1.0, centre + half)
    return low, high


def interval_over_worlds(successes: ArrayLike, worlds: ArrayLike) -> tuple[float, float]:
    """95 % interval (low, high) of the success rate; worlds count as independent, runs of one world do not.

    successes: (N,) booleans. worlds: (N,) world of each episode. This is Wilson's interval with an effective number
    of episodes: the number of independent episodes whose rate would vary as much as this one does between worlds. It
    lies between the number of worlds, if runs always agree, and N; one run of each world gives Wilson's interval
    itself. Unlike a bootstrap over worlds, the interval does not shrink to nothing where all episodes succeed or all
    fail: the effective number is then that of runs that always agree. Raises InputError if the shapes differ.
    Recommended for clustered data by Franco, Little, Louis and Slud 2019, PMC6690503.
    """
    successes, worlds = np.asarray(successes, dtype=np.float64), np.asarray(worlds)
    if successes.shape != worlds.shape:
        raise InputError(f"successes has shape {successes.shape}, worlds {worlds.shape}: must be the same")
    n = successes.size
    if n == 0:
        return wilson_interval(0, 0)
    _, index = np.unique(worlds, return_inverse=True)
    runs, hits = np.bincount(index), np.bincount(index, weights=successes)
    rate = float(hits.sum()) / n
    if rate in (0.0, 1.0):
        effective = n**2 / float((runs**2).sum())  # the number of worlds, if all have equally many runs
    else:
        # the variance of the rate, by worlds, as if it were that of `effective` independent episodes
        variance = float(((hits - rate * runs) ** 2).sum()) / n**2
        effective = rate * (1 - rate) / max(variance, rate * (1 - rate) / n)
    return wilson_interval(rate * effective, effective)


def mean_std_over_runs(
    values: ArrayLike, runs: ArrayLike, chosen: ArrayLike | None = None
) -> tuple[float, float]:
    """Mean and population standard deviation of the means of the runs: the paper's a ± b.

    values: (N,), one for each episode. runs: (N,) run number of each. chosen: (N,) booleans, the values that count;
    None for all. (NaN, NaN) if none does. Where runs have unequal numbers of episodes, as when one is not finished,
    the mean is taken over episodes: otherwise a run of one episode would weigh as much as one of a hundred. The ± of
    Table II are population standard deviations over 3 runs of 100 worlds (over 2 in the rows LME-DWA and LME-DRL).
    """
    values, runs = np.asarray(values, dtype=np.float64), np.asarray(runs)
    counts = np.ones(values.shape, dtype=bool) if chosen is None else np.asarray(chosen, dtype=bool)
    if values.shape != runs.shape:
        raise InputError(f"values has shape {values.shape}, runs {runs.shape}: must be the same")
    if values.shape != counts.shape:
        raise InputError(f"values has shape {values.shape}, chosen {counts.shape}: must be the same")
    if not counts.any():
        return math.nan, math.nan
    _, episodes = np.unique(runs, return_counts=True)
    # Sorted by run once: a mask for every run would take time in proportion to runs times episodes.
    chosen_values, chosen_runs = values[counts], runs[counts]
    order = np.argsort(chosen_runs, kind="stable")
    starts = np.flatnonzero(np.diff(chosen_runs[order])) + 1
    means = [of_run.mean() for of_run in np.split(chosen_values[order], starts)]
    mean = np.mean(means) if len(set(episodes.tolist())) == 1 else chosen_values.mean()
    return float(mean), float(np.std(means))
