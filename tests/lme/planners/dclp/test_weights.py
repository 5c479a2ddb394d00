import numpy as np
import pytest

from lme.inputs.onnx_graph import OnnxGraph, read_weights
from lme.planners.dclp.weights import SHAPES, SIGNATURE, write_weights
from tests.networks import network_file, random_weights, refused


def read(path):
    return read_weights(path, SIGNATURE.what, SHAPES)


def test_written_weights_come_back_and_the_bytes_are_the_same(tmp_path):
    first, second = (network_file(tmp_path / f"{name}.onnx") for name in "ab")
    assert first.read_bytes() == second.read_bytes()
    weights, wanted = read(first), random_weights()
    assert list(weights) == list(SHAPES)
    assert all((weights[name] == wanted[name]).all() for name in SHAPES)


def test_a_file_of_something_else_is_refused(tmp_path):
    assert "cannot be read" in refused(read, tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_text("weights")
    assert "it is damaged, or no ONNX file" in refused(read, tmp_path / "text.onnx")


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (None, "alpha is missing"),
        (np.zeros((7, 32), np.float32), "has the shape (7, 32): must be float32 (6, 32)"),
    ],
)
def test_weights_of_another_kind(tmp_path, array, said):
    weights = {} if array is None else {**random_weights(), "convolution_1.kernel": array}
    path = tmp_path / "w.onnx"
    path.write_bytes(OnnxGraph(weights).model(SIGNATURE))
    assert said in refused(read, path)


def test_writing_needs_every_array(tmp_path):
    with pytest.raises(KeyError), (tmp_path / "w.onnx").open("wb") as file:
        write_weights({}, file)
