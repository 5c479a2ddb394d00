"""ONNX files: which of them are run, and what is said of the others."""

import copy

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from lme.errors import InputError
from lme.inputs import onnx_file
from lme.inputs.onnx_file import KIND, TRAINED, OnnxNetwork, Signature, SignedNetwork
from lme.inputs.onnx_graph import OnnxGraph, read_weights
from tests.networks import refused

SIGNATURE = Signature("toy", "a toy network", {"x": (2,)}, {"y": (3,)}, (1, 2))
WEIGHTS = {
    "layer.kernel": np.arange(6.0, dtype=np.float32).reshape(2, 3),
    "layer.bias": np.ones(3, np.float32),
}


@pytest.fixture
def written(tmp_path):
    """Writes the toy network, after `change` has altered it."""

    def write(change=None, trained=((0.0, 1.0),), weights=WEIGHTS):
        graph = OnnxGraph(weights)
        graph.reshape(graph.linear(graph.reshape("x", 1, 2), "layer"), 3, output="y")
        content = graph.model(SIGNATURE, np.array(trained))
        if change is not None:
            model = onnx.load_model_from_string(content)
            change(model)
            content = model.SerializeToString()
        path = tmp_path / "toy.onnx"
        path.write_bytes(content)
        return path

    return write


def signed(path):
    return SignedNetwork(path, SIGNATURE)


def test_a_written_network_answers_and_says_what_it_was_trained_for(written):
    network = signed(written())
    (answer,) = network.answer(np.array([1.0, 2.0]))
    assert answer == pytest.approx([0.0 + 2.0 * 3.0 + 1.0, 1.0 + 2.0 * 4.0 + 1.0, 2.0 + 2.0 * 5.0 + 1.0])
    assert answer.dtype == np.float64
    assert network.trained.tolist() == [[0.0, 1.0]]


def test_the_same_weights_give_the_same_bytes_and_come_back(written):
    content = written().read_bytes()
    assert written().read_bytes() == content
    weights = read_weights(written(), "a toy network")
    for name, array in WEIGHTS.items():
        np.testing.assert_array_equal(weights[name], array)


def test_a_copy_shares_the_network(written):
    network = OnnxNetwork(written())
    assert copy.deepcopy([network])[0] is network


def _kind(model):
    helper.set_model_props(model, {KIND: "other"})


def _unmarked(model):
    del model.metadata_props[:]


def _input(model):
    first = next(node for node in model.graph.node if "x" in node.input)
    model.graph.input[0].name = first.input[0] = "z"


def _batch(model):
    model.graph.input[0].CopyFrom(helper.make_tensor_value_info("x", TensorProto.FLOAT, (1, 2)))


def _output(model):
    model.graph.output[0].CopyFrom(helper.make_tensor_value_info("y", TensorProto.INT64, (3,)))
    model.graph.node[-1].output[0] = "before"
    model.graph.node.append(helper.make_node("Cast", ["before"], ["y"], to=TensorProto.INT64))


def _shape(model):
    model.graph.output[0].CopyFrom(helper.make_tensor_value_info("y", TensorProto.FLOAT, None))
    model.graph.node[-1].output[0] = "before"
    model.graph.node.append(helper.make_node("Concat", ["before", "before"], ["y"], axis=0))


def _untrained(model):
    helper.set_model_props(model, {KIND: "toy", TRAINED: "[1, 2]"})


def _nested(model):
    helper.set_model_props(model, {KIND: "toy", TRAINED: "[" * 10_000})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_kind, "is of the kind 'other': must be a toy network"),
        (_unmarked, "is not marked as one of lme's networks: must be a toy network"),
        (_input, "takes {'z'"),
        (_batch, "takes {'x': ((1, 2)"),
        (_output, "gives [('y', 'tensor(int64)')]: must be a toy network"),
        (_shape, "gives [(6,)]: must be a toy network"),
        (_untrained, "must hold what the network was trained for, (1, 2) numbers"),
        (_nested, "must hold what the network was trained for"),
    ],
)
def test_a_network_that_is_not_as_it_should_be(written, change, says):
    assert says in refused(signed, written(change))


def test_answers_and_weights_that_are_not_finite(written):
    path = written(weights={**WEIGHTS, "layer.bias": np.full(3, np.nan, np.float32)})
    assert "answers with values that are not finite" in refused(signed, path)
    assert "layer.bias holds values that are not finite" in refused(
        lambda path: read_weights(path, "a toy network"), path
    )


def _sparse(model):
    """A tensor of a sparse constant, which is of an attribute of a node."""
    values = TensorProto(name="v", data_location=TensorProto.EXTERNAL, dims=[1], data_type=TensorProto.FLOAT)
    indices = helper.make_tensor("i", TensorProto.INT64, (1,), [0])
    attribute = helper.make_attribute("sparse_value", helper.make_sparse_tensor(values, indices, [3]))
    model.graph.node.append(helper.make_node("Constant", [], ["c"]))
    model.graph.node[-1].attribute.append(attribute)


def _weight(model):
    model.graph.initializer[0].data_location = TensorProto.EXTERNAL
    model.graph.initializer[0].external_data.add(key="location", value="data")


def _branch(model):
    """A tensor of a graph in a graph."""
    inner = helper.make_graph([], "inner", [], [], [])
    inner.initializer.add(name="v", data_location=TensorProto.EXTERNAL)
    model.graph.node.append(helper.make_node("If", ["x"], ["c"], then_branch=inner, else_branch=inner))


@pytest.mark.parametrize("change", [_weight, _sparse, _branch])
def test_tensors_in_other_files_are_never_read(written, monkeypatch, tmp_path, change):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").write_bytes(bytes(1000))
    path = written(change)
    for read in (signed, OnnxNetwork, lambda path: read_weights(path, "a toy network")):
        assert "its weights are in another file: export all into one" in refused(read, path)


def test_a_file_that_is_too_large_is_not_read(written, monkeypatch):
    path = written()
    monkeypatch.setattr(onnx_file, "NETWORK_BYTES", path.stat().st_size - 1)
    assert "must have at most" in refused(signed, path)


def test_no_damage_gives_a_traceback(written):
    whole, rng = written().read_bytes(), np.random.default_rng(0)
    path, message = written(), ""
    for i in range(300):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged if i % 5 else damaged[: rng.integers(len(whole))]))
        for read in (signed, lambda path: read_weights(path, "a toy network")):
            try:
                read(path)
            except InputError as raised:
                message = str(raised)
            assert "\n" not in message
    assert message


@pytest.mark.parametrize("package", ["onnx", "onnxruntime"])
def test_without_its_package_a_line_says_what_to_install(written, monkeypatch, package):
    path = written()
    monkeypatch.setitem(__import__("sys").modules, package, None)
    read = signed if package == "onnxruntime" else lambda path: read_weights(path, "a toy network")
    with pytest.raises(InputError, match=f"needs {package}: pip install '{package}"):
        read(path)
