"""Archives as Stable-Baselines3 and PyTorch write them, by hand, so that tests can damage them and need neither."""

import io
import zipfile

import numpy as np

FLOAT = "torch FloatStorage"
REBUILD = "torch._utils _rebuild_tensor_v2"


def text(value):
    """The pickle of a short string."""
    raw = value.encode()
    return b"X" + len(raw).to_bytes(4, "little") + raw


def number(value):
    return b"\x8a\x08" + value.to_bytes(8, "little", signed=True)


def name_of(value):
    """The pickle of a class or function."""
    module, _, name = value.partition(" ")
    return f"c{module}\n{name}\n".encode()


def numbers(values):
    return b"(" + b"".join(number(value) for value in values) + b"t"


def tensor(key, shape, offset=0, stride=None, kind=FLOAT, rebuild=REBUILD):
    """The pickle of a tensor whose numbers are in data/KEY."""
    if stride is None:
        stride = [int(np.prod(shape[i + 1 :])) for i in range(len(shape))]
    storage = b"(" + text("storage") + name_of(kind) + text(key) + text("cpu") + number(1) + b"tQ"
    hooks = b"\x89" + name_of("collections OrderedDict") + b")R"
    return (
        name_of(rebuild) + b"(" + storage + number(offset) + numbers(shape) + numbers(stride) + hooks + b"tR"
    )


def state(entries):
    """The pickle of a `state_dict` with these values, pickles themselves, by name."""
    pairs = b"".join(text(name) + value for name, value in entries.items())
    versions = b"}" + text("_metadata") + name_of("collections OrderedDict") + b")Rs"
    return b"\x80\x02" + name_of("collections OrderedDict") + b")Rq\x00(" + pairs + b"u" + versions + b"b."


def saved(weights, changed=None, pickle=None, left_out=()):
    """What `torch.save` writes for these arrays: the bytes of a zip.

    changed: other pickles of some tensors, by name. pickle: instead of the whole description.
    """
    entries = {name: tensor(str(i), array.shape) for i, (name, array) in enumerate(weights.items())}
    members = {f"archive/data/{i}": array.astype("<f4").tobytes() for i, array in enumerate(weights.values())}
    members["archive/data.pkl"] = pickle or state({**entries, **(changed or {})})
    return zipped({name: content for name, content in members.items() if name not in left_out})


def archive(path, weights, **damage):
    """An archive of these weights and of a critic's as PPO saves it. Returns the path."""
    weights = {**weights, "value_net.bias": np.zeros(1, np.float32)}
    path.write_bytes(zipped({"data": b"{}", "policy.pth": saved(weights, **damage)}))
    return path


def zipped(members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as made:
        for name, content in members.items():
            made.writestr(name, content)
    return file.getvalue()
