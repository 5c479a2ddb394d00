import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.kernels.sight import discs_in_sight
from tests import oracles
from tests.tolerances import KERNEL


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_equals_looking_at_every_beam(seed):
    rng = np.random.default_rng(seed)
    num_beams, fov = int(rng.integers(1, 80)), rng.choice([1.0, 4.0, math.tau])
    angles = (rng.uniform(-4, 4), fov / num_beams)
    ranges = rng.choice([1.0, 2.0, 3.0, 0.01, np.nan, np.inf], num_beams).astype(np.float32)
    discs = np.column_stack((rng.uniform(-4, 4, (12, 2)), rng.uniform(0.1, 0.5, 12)))
    lidar, base = (tuple(rng.uniform(-1, 1, 3)) for _ in range(2))
    given = (discs, rng.normal(size=(12, 2)), ranges, angles, (0.1, 3.5, 0.1), lidar, base)
    assert discs_in_sight(*given) == pytest.approx(oracles.discs_in_sight(*given), abs=KERNEL)


def test_it_is_compiled_once():
    assert len(discs_in_sight.signatures) == 1
