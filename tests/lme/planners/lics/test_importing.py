"""Import of a file of PyTorch: what it reads, and what it refuses."""

import os
from pathlib import Path

import numpy as np
import pytest

from lme.guides.lme.weight_files import find_network
from lme.inputs.onnx_graph import read_weights
from lme.planners.lics.importing import import_state
from lme.planners.lics.weights import SHAPES, SIGNATURE
from tests.networks import random_lics, refused
from tests.torch_archives import saved, zipped

REAL = os.environ.get("LICS_STATE")
BIAS = "prediction_head.bias"


def written(path, weights, **damage):
    path.write_bytes(saved(weights, **damage))
    return path


def test_the_tensors_come_back_and_others_stay_behind(tmp_path):
    weights = random_lics()
    unused = {"decoder.layers.0.self_attn_layer_norm.bias": np.zeros(32, np.float32)}
    found = import_state(written(tmp_path / "a.pth", {**weights, **unused}))
    assert list(found) == list(SHAPES)
    for name, array in found.items():
        np.testing.assert_array_equal(array, weights[name])


def test_what_is_not_such_a_network_is_refused(tmp_path, says):
    weights = random_lics()
    assert "cannot be read" in refused(import_state, tmp_path / "none.pth")
    (tmp_path / "text.pth").write_text("weights")
    says(refused(import_state, tmp_path / "text.pth"))
    (tmp_path / "empty.pth").write_bytes(zipped({"data": b""}))
    assert "PyTorch 1.6 or newer" in refused(import_state, tmp_path / "empty.pth")
    missing = {name: array for name, array in weights.items() if name != BIAS}
    says(refused(import_state, written(tmp_path / "b.pth", missing)))
    other = {**weights, BIAS: np.zeros(3, np.float32)}
    says(refused(import_state, written(tmp_path / "c.pth", other)))
    broken = {**weights, BIAS: np.full(2, np.nan, np.float32)}
    assert "not finite" in refused(import_state, written(tmp_path / "d.pth", broken))


@pytest.mark.skipif(not REAL, reason="LICS_STATE names no transformer_99.pth")
def test_the_shipped_network_is_the_authors():
    shipped, theirs = read_weights(find_network("lics_ki"), SIGNATURE.what), import_state(Path(REAL))
    for name, array in theirs.items():
        np.testing.assert_array_equal(array, shipped[name])
