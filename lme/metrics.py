"""How well an episode went, and how well many did: the paper's figures and two that it leaves out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lme.errors import InputError
from lme.types import Outcome

Z_95 = 1.959963984540054  # two-sided 95 % quantile of the standard normal


def barn_metric(success: bool, time_s: float, optimal_time_s: float) -> float:
    """I(success) · OT / clip(AT, 2 OT, 8 OT): 0 on failure, else 1/8 (slow) to 1/2 (as fast as counts).

    time_s: actual traversal time AT [s]. optimal_time_s: OT [s]; NaN where a map has none, and so for a success.
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
    Anderson et al. 2018, arXiv 1807.06757. A start that is the goal counts 1.
    """
    if not success:
        return 0.0
    longest = max(path_m, shortest_m)
    return shortest_m / longest if longest > 0 else 1.0


def reward(outcome: Outcome | str, steps: int, max_steps: int, crash: float, timeout: float) -> float:
    """R of an episode: 1 − L/L_max on success, else the penalty R_c or R_t (paper eq. 1).

    crash, timeout: R_c and R_t, negative (the paper's example: −0.2). Raises InputError for another outcome
    or a max_steps below 1.
    """
    if max_steps < 1:
        raise InputError(f"max_steps is {max_steps}: must be at least 1")
    if outcome == Outcome.SUCCESS:
        return 1.0 - steps / max_steps
    penalties: dict[str, float] = {Outcome.COLLISION: crash, Outcome.TIMEOUT: timeout}
    if outcome not in penalties:
        raise InputError(f"outcome is {outcome!r}: must be one of {', '.join(Outcome)}")
    return penalties[outcome]


def wilson_interval(successes: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """Confidence interval of a proportion: (low, high) in [0, 1]; (0, 1) when n is 0.

    z: quantile of the standard normal; the default gives 95 %. Raises InputError unless 0 ≤ successes ≤ n.
    Wilson 1927, DOI 10.1080/01621459.1927.10502953.
    """
    if not 0 <= successes <= n:
        raise InputError(f"successes is {successes} of n = {n}: must lie between 0 and n")
    if n == 0:
        return 0.0, 1.0
    # scipy.stats.binomtest(successes, n).proportion_ci(method="wilson") is the same; its import takes a second.
    rate, shift = successes / n, z * z / n
    centre = (rate + shift / 2) / (1 + shift)
    half = z * math.sqrt(rate * (1 - rate) / n + shift / (4 * n)) / (1 + shift)
    # At 0 and n the bound is exactly 0 and 1; rounding must not say otherwise.
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == n else min(1.0, centre + half)
    return low, high


def mean_std_over_runs(values: ArrayLike, runs: ArrayLike) -> tuple[float, float]:
    """Mean over runs of the per-run mean, and its population standard deviation: the paper's a ± b.

    values: (N,); runs: (N,) run number of each value. (NaN, NaN) when there are none. Table II's ± are
    population deviations over 3 runs of 100 worlds (2 for the LME-DWA and LME-DRL rows).
    """
    values, runs = np.asarray(values, dtype=np.float64), np.asarray(runs)
    if values.shape != runs.shape:
        raise InputError(f"values has shape {values.shape}, runs {runs.shape}: must be the same")
    if values.size == 0:
        return math.nan, math.nan
    means = [values[runs == run].mean() for run in np.unique(runs)]
    return float(np.mean(means)), float(np.std(means))
