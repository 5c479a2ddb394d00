"""A beam pattern that never repeats and fills the field of view evenly for any number of beams."""

import math

import numpy as np
from numba import njit

from lme.types import Floats

# Kronecker sequence of the plastic number ρ, ρ³ = ρ + 1: (1/ρ, 1/ρ²) fills a square most evenly.
# Source: M. Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
_TURN, _RISE = 0.7548776662466927, 0.5698402909980532


@njit(cache=True, error_model="numpy")
def beam_pattern(
    first: int, number: int, phase: tuple[float, float], elevations: tuple[float, float]
) -> Floats:
    """Unit vectors of `number` beams from beam `first` on, at all azimuths between two elevations: (number, 3).

    phase: position of beam 0 in azimuth and in elevation, as shares of the field of view; elevations: lowest and
    highest [rad].
    """
    beams = np.empty((number, 3))
    low, span = elevations[0], elevations[1] - elevations[0]
    for i in range(number):
        turn, rise = phase[0] + (first + i) * _TURN, phase[1] + (first + i) * _RISE
        azimuth = 2.0 * math.pi * (turn - math.floor(turn))
        elevation = low + span * (rise - math.floor(rise))
        flat = math.cos(elevation)
        beams[i, 0], beams[i, 1] = flat * math.cos(azimuth), flat * math.sin(azimuth)
        beams[i, 2] = math.sin(elevation)
    return beams
