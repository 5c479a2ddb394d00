"""A beam pattern that never repeats and fills the field of view evenly, and the noise of its beams."""

import math

import numpy as np
from numba import njit

from lme.types import Floats

# Kronecker sequence of the plastic number ρ, ρ³ = ρ + 1: (1/ρ, 1/ρ²) fills a square most evenly.
# Source: M. Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
_TURN, _RISE = 0.7548776662466927, 0.5698402909980532

MOST_NOISE = 2.0 * math.sqrt(3.0)  # [σ] bound of `noise_of`

# SplitMix64. Source: G. Steele, D. Lea, C. Flood 2014, "Fast splittable pseudorandom number generators".
_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_PART, _PARTS = np.uint64(0xFFFF), (np.uint64(16), np.uint64(32), np.uint64(48))


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
        turn, rise = turn_share(first + i, phase[0]), rise_share(first + i, phase[1])
        azimuth, elevation = 2.0 * math.pi * turn, low + span * rise
        flat = math.cos(elevation)
        beams[i, 0], beams[i, 1] = flat * math.cos(azimuth), flat * math.sin(azimuth)
        beams[i, 2] = math.sin(elevation)
    return beams


@njit(cache=True, error_model="numpy")
def beam_noise(first: int, number: int, seed: int) -> Floats:
    """Noise of mean 0 and variance 1 of `number` beams from beam `first` on, at most MOST_NOISE: (number,).

    It is almost normal: the sum of four uniform numbers, with a kurtosis of 2.7 instead of 3.
    """
    noise = np.empty(number)
    for i in range(number):
        noise[i] = noise_of(first + i, np.uint64(seed))
    return noise


@njit(cache=True, error_model="numpy")
def turn_share(beam, phase):
    """Azimuth of a beam as a share of a turn, in [0, 1)."""
    turn = phase + beam * _TURN
    return turn - np.floor(turn)


@njit(cache=True, error_model="numpy")
def rise_share(beam, phase):
    """Elevation of a beam as a share of the field of view, in [0, 1)."""
    rise = phase + beam * _RISE
    return rise - np.floor(rise)


@njit(cache=True, error_model="numpy")
def noise_of(beam, seed):
    """The noise of one beam: the same for the same beam and seed, whichever beams are requested."""
    mixed = seed + (np.uint64(beam) + np.uint64(1)) * _STEP
    mixed = (mixed ^ (mixed >> _SHIFTS[0])) * _MIX_1
    mixed = (mixed ^ (mixed >> _SHIFTS[1])) * _MIX_2
    mixed = mixed ^ (mixed >> _SHIFTS[2])
    total = (mixed & _PART) + ((mixed >> _PARTS[0]) & _PART) + ((mixed >> _PARTS[1]) & _PART)
    total += mixed >> _PARTS[2]
    return (float(total) - 131070.0) * (
        math.sqrt(3.0) / 65536.0
    )  # four of mean 65535 / 2, variance 65536² / 12
