import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.dense import dense
from tests import oracles
from tests.tolerances import FLOAT32_LAYER


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 40), st.integers(1, 9))
def test_equals_the_product_of_matrices(seed, rows, depth, width):
    rng = np.random.default_rng(seed)
    inputs, kernel, bias = (
        rng.normal(size=shape).astype(np.float32) for shape in ((rows, depth), (depth, width), (width,))
    )
    for slope in (0.2, 1.0):
        wanted = oracles.dense(inputs, kernel, bias, slope)
        assert dense(inputs, kernel, bias, slope) == pytest.approx(wanted, abs=10 * FLOAT32_LAYER)
    assert len(dense.signatures) == 1
