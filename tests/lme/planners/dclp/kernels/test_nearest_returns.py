import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.points import beam_directions
from lme.planners.dclp.kernels.nearest_returns import nearest_returns
from tests import oracles
from tests.tolerances import KERNEL

SECTORS = 12
MIDDLES = beam_directions(math.pi / SECTORS, math.tau / SECTORS, SECTORS)


@given(st.integers(0, 2**32 - 1))
def test_equals_looking_at_every_sector(seed):
    rng = np.random.default_rng(seed)
    num_beams = int(rng.integers(0, 60))
    start, increment = rng.uniform(-7, 7), rng.choice([-1, 1]) * rng.uniform(0.01, 0.1)
    angles = start + increment * np.arange(num_beams)
    sectors = np.floor(angles / (math.tau / SECTORS)).astype(np.int64) % SECTORS
    ranges = rng.choice([0.5, 1.0, 2.0, 5.0, 0.0, np.nan, np.inf, 30.0], num_beams).astype(np.float32)
    limits, offset = (0.1, 30.0, 5.0), tuple(rng.uniform(-0.3, 0.3, 2))
    given = (ranges, sectors, beam_directions(start, increment, num_beams), limits, 4.0 * MIDDLES, offset)
    wanted = oracles.nearest_returns(ranges, sectors, angles, limits, 4.0 * MIDDLES, offset)
    assert nearest_returns(*given) == pytest.approx(wanted, abs=KERNEL)


def test_a_return_at_the_base_has_no_direction():
    middle = np.array([[1.0, 0.0]])
    (seen,) = nearest_returns(
        np.array([0.5], np.float32), np.zeros(1, np.int64), middle, (0.1, 9.0, 5.0), middle, (-0.5, 0.0)
    )
    assert list(seen) == [0.0, 0.0, 0.0]
