"""Random networks for tests, as weights, as files, and as TensorFlow checkpoints."""

import numpy as np
import pytest

from lme.errors import InputError
from lme.guides.learned_subgoal import network as subgoal
from lme.inputs.onnx_file import TRAINED, SignedNetwork
from lme.planners import ipaprec, lics
from lme.planners.dclp.importing import INDEX, SHARD, crc32c, masked, tensor_names
from lme.planners.dclp.weights import REPORTED, SHAPES, write_weights
from lme.planners.drl_vo import weights as drl_vo

MAGIC = (0xDB4775248B80FB57).to_bytes(8, "little")
TINY = drl_vo.Sizes(channels=2, features=5, hidden=4)  # of a DRL-VO network that answers at once
ENTRIES_PER_BLOCK = 5  # several blocks, with keys that share their beginnings


def random_weights(seed=0):
    """Weights of the published shapes, small enough that no layer saturates."""
    rng = np.random.default_rng(seed)
    weights = {
        name: (rng.normal(size=shape) / np.sqrt(shape[0] if shape else 10)).astype(np.float32)
        for name, shape in SHAPES.items()
    }
    return {**weights, TRAINED: np.array([[0.0, 100.0]] * 7, np.float32)}


def signed(signature, path, write_weights, weights):
    """The network of a kind with these weights, which are left in a file at the path."""
    with path.open("wb") as file:
        write_weights(weights, file)
    return SignedNetwork(path, signature)


def network_file(path, seed=0, trained=None):
    """A weight file of a random network. trained: ranges that differ, by what they are of."""
    weights = random_weights(seed)
    for key, span in (trained or {}).items():
        weights[TRAINED][REPORTED.index(key)] = span
    with path.open("wb") as file:
        write_weights(weights, file)
    return path


def random_subgoal(seed=0):
    """Weights of a subgoal network that are so large that all inputs matter, for any robot."""
    rng = np.random.default_rng(seed)
    made = {
        name: (rng.normal(size=shape) / np.sqrt(shape[0])).astype(np.float32)
        for name, shape in subgoal.SHAPES.items()
    }
    return {**made, TRAINED: np.array([[0.0, 100.0]] * len(subgoal.REPORTED), np.float32)}


def subgoal_file(path, seed=0):
    """A weight file of a random subgoal network."""
    with path.open("wb") as file:
        subgoal.write_weights(random_subgoal(seed), file)
    return path


def random_lics(seed=0):
    """Weights of a LiCS network that are so large that all inputs matter."""
    rng = np.random.default_rng(seed)
    return {
        name: (rng.normal(size=shape) / np.sqrt(shape[-1])).astype(np.float32)
        for name, shape in lics.SHAPES.items()
    }


def lics_file(path, seed=0):
    """A weight file of a random LiCS network."""
    with path.open("wb") as file:
        lics.write_weights(random_lics(seed), file)
    return path


def random_ipaprec(sectors=32, seed=0):
    """Weights of a network of MAER-Nav's kind that are so large that all inputs matter."""
    rng = np.random.default_rng(seed)
    return {
        name: (rng.normal(size=shape) / np.sqrt(shape[0] if shape else 10)).astype(np.float32)
        for name, shape in ipaprec.shapes(sectors).items()
    }


def ipaprec_file(path, sectors=32, seed=0):
    """A weight file of a random network of MAER-Nav's kind."""
    with path.open("wb") as file:
        ipaprec.write_weights(random_ipaprec(sectors, seed), file)
    return path


def onnx_file(path, inputs=("scan", "target"), seed=0, hidden=8, outputs=2, dtype=1):
    """An ONNX file of a random perceptron of one hidden layer.

    inputs: names, or pairs of a name and the numbers that it takes. Without numbers it takes the mean of any number of
    them. dtype: of `onnx.TensorProto`.
    """
    import onnx
    from onnx import helper

    sizes = [(each, None) if isinstance(each, str) else each for each in inputs]
    rng, kind = np.random.default_rng(seed), helper.tensor_dtype_to_np_dtype(dtype)
    nodes, seen = [], []
    for name, size in sizes:
        seen.append(name if size else f"{name}_mean")
        if not size:
            nodes.append(helper.make_node("ReduceMean", [name], [seen[-1]], axes=[1], keepdims=1))
    width = sum(size or 1 for _, size in sizes)
    layers = {"w1": (width, hidden), "w2": (hidden, outputs)}
    tensors = [
        onnx.numpy_helper.from_array((rng.normal(size=shape) / np.sqrt(shape[0])).astype(kind), name)
        for name, shape in layers.items()
    ]
    nodes += [
        helper.make_node("Concat", seen, ["joined"], axis=1),
        helper.make_node("MatMul", ["joined", "w1"], ["h"]),
        helper.make_node("Tanh", ["h"], ["t"]),
        helper.make_node("MatMul", ["t", "w2"], ["action"]),
    ]
    given = [helper.make_tensor_value_info(name, dtype, (1, size)) for name, size in sizes]
    answer = [helper.make_tensor_value_info("action", dtype, (1, outputs))]
    graph = helper.make_graph(nodes, "policy", given, answer, tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def checkpoint(prefix, weights, changed=None, crc=None, header=b"\x08\x01", names=None):
    """A TensorFlow V2 checkpoint of these weights and of a critic's. Returns the prefix.

    changed: entries that differ, by tensor: (dtype, shape, offset, size). crc: instead of every right one.
    names: of the tensors, by ours; None: those of DRL-DCLP.
    """
    tensors = {theirs: weights[ours] for ours, theirs in (names or tensor_names()).items()}
    tensors = {name: array[None] if _is_convolution(name) else array for name, array in tensors.items()}
    tensors["main/values/q1/dense/bias"] = np.arange(3, dtype=np.float32)
    data, entries = b"", {b"": header}
    for name in sorted(tensors):
        raw = tensors[name].astype("<f4").tobytes()
        given = (changed or {}).get(name, (1, tensors[name].shape, len(data), len(raw)))
        entries[name.encode()] = _entry(*given, masked(crc32c(raw)) if crc is None else crc)
        data += raw
    prefix.with_name(prefix.name + SHARD).write_bytes(data)
    prefix.with_name(prefix.name + INDEX).write_bytes(table(entries))
    return prefix


def table(entries, kind=0):
    """A LevelDB table. kind: the type of its blocks."""
    items, out, index = list(entries.items()), b"", {}
    for i in range(0, len(items), ENTRIES_PER_BLOCK):
        part = dict(items[i : i + ENTRIES_PER_BLOCK])
        index[list(part)[-1]] = varint(len(out)) + varint(len(_block(part)))
        out += _with_trailer(_block(part), kind)
    handles = varint(len(out)) + varint(len(_block({})))
    out += _with_trailer(_block({}), kind)
    handles += varint(len(out)) + varint(len(_block(index)))
    return out + _with_trailer(_block(index), kind) + handles.ljust(40, b"\0") + MAGIC


def varint(number):
    """Seven bits a byte, the lowest first."""
    out = b""
    while number > 0x7F:
        out, number = out + bytes([number & 0x7F | 0x80]), number >> 7
    return out + bytes([number])


def _is_convolution(name):
    return "conv1d" in name and name.endswith("kernel")


def _entry(dtype, shape, offset, size, crc):
    dimensions = b"".join(_field(2, _field(1, size)) for size in shape)
    return (
        _field(1, dtype) + _field(2, dimensions) + _field(4, offset) + _field(5, size)
        + bytes([6 << 3 | 5]) + crc.to_bytes(4, "little")
    )  # fmt: skip


def _field(number, value):
    if isinstance(value, bytes):
        return bytes([number << 3 | 2]) + varint(len(value)) + value
    return bytes([number << 3]) + varint(value)


def _block(entries):
    out, before = b"", b""
    for key, value in entries.items():
        shared = next((i for i in range(len(before)) if before[: i + 1] != key[: i + 1]), len(before))
        out += varint(shared) + varint(len(key) - shared) + varint(len(value)) + key[shared:] + value
        before = key
    return out + (0).to_bytes(4, "little") + (1).to_bytes(4, "little")


def _with_trailer(block, kind):
    checked = block + bytes([kind])
    return checked + masked(crc32c(checked)).to_bytes(4, "little")


def random_drl_vo(sizes=TINY, seed=0):
    """Weights of a DRL-VO network, small enough that no layer saturates."""
    rng = np.random.default_rng(seed)
    made = {}
    for name, shape in drl_vo.shapes(sizes).items():
        draw = rng.uniform(0.5, 1.5, shape) if name.endswith("running_var") else rng.normal(size=shape)
        made[name] = (draw / np.sqrt(max(np.prod(shape[1:]), 1))).astype(np.float32)
    return {**made, TRAINED: np.array([0.5, 2.0], np.float32)}


def drl_vo_file(path, seed=0):
    """A weight file of a tiny random DRL-VO network."""
    with path.open("wb") as file:
        drl_vo.write_weights(random_drl_vo(seed=seed), file)
    return path


def refused(read, path):
    """The one line of the error that reading this path raises."""
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message
