import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.simulation.mid360.pattern import (
    MOST_NOISE,
    SECTORS,
    beam_noise,
    beam_table,
    beams_within,
    rise_share,
    share_error,
    turn_share,
)

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_the_table_finds_all_beams_between_two_elevations_of_their_sector_and_few_others(seed):
    rng = np.random.default_rng(seed)
    first, number, phase = int(10 ** rng.uniform(0, 9)), int(rng.integers(1, 3000)), tuple(rng.random(2))
    lowest = rng.uniform(-0.2, 1.1, SECTORS) if rng.random() < 0.8 else np.full(SECTORS, -1.0)
    highest = lowest + rng.choice([0.0, 0.05, 0.3, 2.0, -0.1])
    chosen = beams_within(first, phase[1], tuple(beam_table(number)), lowest, highest)
    assert len(np.unique(chosen)) == len(chosen)
    assert np.isin(chosen, np.arange(number)).all()
    beams = [first + i for i in range(number)]
    rises = np.array([rise_share(beam, phase[1]) for beam in beams])
    turns = np.array([turn_share(beam, phase[0]) - turn_share(first, phase[0]) for beam in beams]) % 1.0
    # The sector of a beam at a border is uncertain by the rounding errors.
    error = 2.0 * share_error(first, number)
    sectors = [
        np.floor((turns + shift) % 1.0 * SECTORS).astype(int) % SECTORS for shift in (-error, 0.0, error)
    ]
    within = [(lowest[s] <= rises) & (rises <= highest[s]) for s in sectors]
    assert np.isin(np.flatnonzero(np.all(within, axis=0)), chosen).all()
    near = [(lowest[s] - 0.02 <= rises) & (rises <= highest[s] + 0.02) for s in sectors]
    wrapped = (rises < 0.02) | (
        rises > 0.98
    )  # the band of the lowest elevation also holds some of the highest
    assert np.isin(chosen, np.flatnonzero(np.any(near, axis=0) | wrapped)).all()


def test_the_noise_of_a_beam_is_its_own_bounded_and_standard():
    noise = beam_noise(0, 200_000, 7)
    assert noise.mean() == pytest.approx(0.0, abs=0.01)
    assert noise.std() == pytest.approx(1.0, abs=0.01)
    assert np.abs(noise).max() <= MOST_NOISE
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.01
    np.testing.assert_array_equal(beam_noise(150, 50, 7), noise[150:200])
    assert not np.array_equal(beam_noise(0, 50, 8), noise[:50])
