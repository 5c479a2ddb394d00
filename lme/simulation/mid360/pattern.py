"""Beams of the Mid-360 and their noise, both computed from a beam's number alone.

The azimuths and elevations of every cloud are those of the first one, rotated. One table therefore finds the beams of
all clouds by their azimuth and elevation.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

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

SECTORS = 360  # of equal azimuth
_BANDS = 64  # of equal elevation in each of them
_ROUNDING = 1e-15  # bound of the rounding error of a share, per beam since the start of the pattern


class BeamTable(NamedTuple):
    """Beams of a cloud by sector of azimuth and band of elevation, both counted from those of the cloud's first beam.

    Cell c = sector · bands + band has the beams order[starts[c]:starts[c + 1]], counted from the first beam.
    """

    starts: NDArray[np.int32]
    order: NDArray[np.int32]


@lru_cache(maxsize=4)
def beam_table(number: int) -> BeamTable:
    """Sort the beams of clouds of `number` beams."""
    beams = np.arange(number)
    sectors, bands = (beams * _TURN % 1.0 * SECTORS).astype(int), (beams * _RISE % 1.0 * _BANDS).astype(int)
    cells = sectors * _BANDS + bands
    starts = np.zeros(SECTORS * _BANDS + 1, np.int32)
    starts[1:] = np.cumsum(np.bincount(cells, minlength=SECTORS * _BANDS))
    return BeamTable(starts, np.argsort(cells, kind="stable").astype(np.int32))


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
        # Spherical to Cartesian coordinates.
        flat = math.cos(elevation)
        beams[i, 0], beams[i, 1] = flat * math.cos(azimuth), flat * math.sin(azimuth)
        beams[i, 2] = math.sin(elevation)
    return beams


@njit(cache=True, error_model="numpy")
def beam_noise(first: int, number: int, seed: int) -> Floats:
    """Noise of mean 0, variance 1 and at most MOST_NOISE, of `number` beams from beam `first` on: (number,).

    It is nearly normal: the sum of four uniform numbers, with a kurtosis of 2.7 instead of 3.
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
    """Noise of one beam, which depends only on beam and seed, not on the other beams requested."""
    mixed = seed + (np.uint64(beam) + np.uint64(1)) * _STEP
    mixed = (mixed ^ (mixed >> _SHIFTS[0])) * _MIX_1
    mixed = (mixed ^ (mixed >> _SHIFTS[1])) * _MIX_2
    mixed = mixed ^ (mixed >> _SHIFTS[2])
    total = (mixed & _PART) + ((mixed >> _PARTS[0]) & _PART) + ((mixed >> _PARTS[1]) & _PART)
    total += mixed >> _PARTS[2]
    return (float(total) - 131070.0) * (
        math.sqrt(3.0) / 65536.0
    )  # four of mean 65535 / 2, variance 65536² / 12


@njit(cache=True, error_model="numpy")
def share_error(first, number):
    """Bound of the rounding errors of the shares of `number` beams from beam `first` on."""
    return _ROUNDING * (first + number)


@njit(cache=True, error_model="numpy")
def beams_within(first, phase, table, lowest, highest):
    """Beams of a cloud whose elevation lies between two shares of the field of view in their sector, and some more.

    first: beam of the cloud, from whose azimuth the sectors are counted; phase: of the elevation; table: a `BeamTable`;
    lowest, highest: (SECTORS,). Returns numbers (N,), counted from the first beam, by sector.
    """
    starts, order = table
    # First and last band of each sector, counted from the first beam's elevation on.
    bands = np.empty((2, SECTORS), np.int64)
    error, rise = share_error(first, len(order)), rise_share(first, phase)
    for s in range(SECTORS):
        low, high = max(lowest[s], 0.0) - rise - error, min(highest[s], 1.0) - rise + error
        bands[0, s] = int(np.floor(low * _BANDS))
        bands[1, s] = int(np.floor(high * _BANDS)) if low <= high else bands[0, s] - 1
    # The bands are counted on beyond the last one, after which comes the first one again.
    chosen, count = np.empty(len(order), np.int32), 0
    for s in range(SECTORS):
        low = bands[0, s] % _BANDS
        stop = low + min(bands[1, s] - bands[0, s] + 1, _BANDS)
        cell = s * _BANDS
        for i in range(starts[cell + low], starts[cell + max(min(stop, _BANDS), low)]):
            chosen[count] = order[i]
            count += 1
        for i in range(starts[cell], starts[cell + max(stop - _BANDS, 0)]):
            chosen[count] = order[i]
            count += 1
    return chosen[:count]
