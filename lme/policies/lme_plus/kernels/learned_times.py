"""Times that a search shows to be the least possible, for later searches."""

import math

from numba import njit

from lme.policies.lme_plus.kernels.travel_grid import GridNumbers, disc_radius
from lme.types import Floats


@njit(cache=True, error_model="numpy")
def learn(
    learned: Floats,
    corner: tuple[int, int],
    times: Floats,
    grid: GridNumbers,
    here: Floats,
    target: Floats,
    most: float,
    v_max: float,
    moves: float,
) -> None:
    """Raise the times of the disc's cells in `learned` (A, B) to what a search found, or to the least that it allows.

    corner: of the frame of the grid in `learned`. times (W, W): see `travel_times`; it has searched all ways of the
    robot at `here` (2,) to the target (2,) of up to `most` [s]. So a cell that it has no time of takes at least `most`,
    less the time of the straight way from the robot, to within the time for one cell. Cells of which that is no more
    than the straight way takes are left out, also if the target `moves` [m]: they are outside of an ellipse.
    """
    low_x, low_y, cell, size = grid
    x, y = (here[0] - low_x) / cell + 0.5, (here[1] - low_y) / cell + 0.5
    to_x, to_y = (target[0] - low_x) / cell + 0.5, (target[1] - low_y) / cell + 0.5
    ellipse = _ellipse(x, y, to_x, to_y, (most * v_max + moves) / cell)
    middle, radius, cell_time = 0.5 * (size + 1.0), disc_radius(size), cell / v_max
    for i in range(1, size + 1):
        half = math.sqrt(max(radius * radius - (i - middle) ** 2, 0.0))
        low, high = _columns(i, ellipse)
        first, last = math.ceil(max(middle - half, low)), int(min(middle + half, high))
        if first > last:
            continue
        known, found = (
            learned[corner[0] + i, corner[1] + first : corner[1] + last + 1],
            times[i, first : last + 1],
        )
        across = (i - x) ** 2
        for n in range(len(known)):  # without branches, for the processor's vectors
            along = first + n - y
            least = most - math.sqrt(across + along * along) * cell_time
            time = found[n] if found[n] < least else least
            known[n] = time if time > known[n] else known[n]


@njit(cache=True, error_model="numpy")
def _ellipse(x, y, to_x, to_y, length):
    """The places on ways of a length between two others [cells]: centre, and a, b, c of a x² + 2 b x y + c y² ≤ 1."""
    apart = math.hypot(to_x - x, to_y - y)
    cos, sin = ((to_x - x) / apart, (to_y - y) / apart) if apart > 0.0 else (1.0, 0.0)
    along, across = 4.0 / length**2, 4.0 / max(length**2 - apart**2, 1e-9)
    a, c = cos * cos * along + sin * sin * across, sin * sin * along + cos * cos * across
    b = cos * sin * (along - across)
    return 0.5 * (x + to_x), 0.5 * (y + to_y), a, b, c


@njit(cache=True, error_model="numpy")
def _columns(row, ellipse):
    """First and last column of the ellipse in a row; the last is before the first if there is none."""
    x, y, a, b, c = ellipse
    off = row - x
    root = (b * off) ** 2 - c * (a * off * off - 1.0)
    if root < 0.0:
        return 1.0, 0.0
    return y - (b * off + math.sqrt(root)) / c, y - (b * off - math.sqrt(root)) / c
