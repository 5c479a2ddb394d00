"""Our transformer answers as PyTorch's, with the authors' weights and with random ones."""

import numpy as np
import pytest

from lme.guides.lme.weight_files import find_network
from lme.inputs.onnx_graph import read_weights
from lme.planners.lics.weights import SIGNATURE, write_weights
from tests.networks import random_lics, signed
from tests.tolerances import FLOAT32_LAYER

pytest.importorskip("torch", reason="PyTorch is not installed")
from tests.lme.planners.lics import published


@pytest.mark.parametrize("name", ["the authors'", "random"])
def test_the_network_answers_as_in_torch(tmp_path, name):
    weights = read_weights(find_network("lics_ki"), SIGNATURE.what) if name != "random" else random_lics()
    network, rng = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, weights), np.random.default_rng(0)
    answers = []
    for _ in range(20):
        ranges = np.minimum(rng.uniform(0.0, 8.0, 720), 5.0).astype(np.float32)
        bearing = rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(bearing), np.sin(bearing)])
        answers.append(network.answer(ranges, direction)[0])
        assert answers[-1] == pytest.approx(published.answer(weights, ranges, direction), abs=FLOAT32_LAYER)
    assert np.ptp(answers, axis=0).min() > 100 * FLOAT32_LAYER  # the inputs matter
