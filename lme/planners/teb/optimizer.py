"""Levenberg–Marquardt on a timed elastic band."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dpbsv

from lme.types import Floats

# g2o's OptimizationAlgorithmLevenberg
_FIRST_DAMPING = 1e-5  # of the greatest diagonal element
_TRIALS = 10  # of damping in one iteration
_LEAST_SCALE, _GREATEST_SCALE = 1.0 / 3.0, 2.0 / 3.0  # of the damping after success
_LEAST_GAIN = 1e-3  # keeps the expected gain from zero

Equations = Callable[[Floats, Floats], tuple[float, Floats, Floats]]


def optimize(
    poses: Floats, times: Floats, equations: Equations, iterations: int
) -> tuple[Floats, Floats, float]:
    """Return the band after a number of iterations, and its sum of squared errors.

    equations: gives the sum, the banded matrix and the descent at a band
    (`lme.planners.teb.kernels.normal_equations`). The damping is that of g2o (Kümmerle et al. 2011, DOI
    10.1109/ICRA.2011.5979949). A step to a time difference that is not positive is refused. The sum is inf if it is
    not finite at the given band.
    """
    total, matrix, descent = equations(poses, times)
    if not np.isfinite(total):
        return poses, times, np.inf
    damping, growth = _FIRST_DAMPING * float(matrix[0].max()), 2.0
    for _ in range(iterations):
        for _ in range(_TRIALS):
            # Try a step; it must keep all time differences positive.
            step = _step(matrix, descent, damping)
            new_band = poses + step[:, :3], times + step[:-1, 3]
            candidate = equations(*new_band) if new_band[1].min() > 0.0 else (np.inf, matrix, descent)
            # Ratio of the actual to the expected decrease of the sum.
            flat = step.ravel()
            gain = (total - candidate[0]) / float(flat @ (damping * flat + descent) + _LEAST_GAIN)
            if gain > 0.0 and np.isfinite(candidate[0]):
                (poses, times), (total, matrix, descent) = new_band, candidate
                # Accepted: less damping the better the prediction was.
                damping *= min(max(1.0 - (2.0 * gain - 1.0) ** 3, _LEAST_SCALE), _GREATEST_SCALE)
                growth = 2.0
                break
            # Refused: more damping, ever faster.
            damping, growth = damping * growth, growth * 2.0
        else:
            break
    return poses, times, total


def _step(matrix: Floats, descent: Floats, damping: float) -> Floats:
    """Damped step (N, 4) of all variables; zero if the damped matrix is not positive definite."""
    damped = matrix.copy()
    damped[0] += damping
    _, step, failed = dpbsv(damped, descent, lower=1, overwrite_ab=1)
    return np.zeros((len(descent) // 4, 4)) if failed else step.reshape(-1, 4)
