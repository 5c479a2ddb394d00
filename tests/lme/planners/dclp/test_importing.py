"""Import of a TensorFlow checkpoint: what it reads, and what it refuses. The authors' own is not part of the tests."""

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.inputs.onnx_file import TRAINED
from lme.planners.dclp.importing import INDEX, SHARD, crc32c, import_checkpoint, read_entries
from lme.planners.dclp.weights import SHAPES, SIGNATURE, write_weights
from tests import oracles
from tests.networks import checkpoint, random_weights, refused, signed, table

REAL = os.environ.get("DCLP_CHECKPOINT")
BIAS = "main/pi/conv1d/bias"


def part(prefix, ending):
    return prefix.with_name(prefix.name + ending)


@pytest.fixture
def prefix(tmp_path):
    return checkpoint(tmp_path / "step-100", random_weights())


@pytest.mark.parametrize("ending", ["", INDEX, SHARD, ".meta"])
def test_the_tensors_come_back(prefix, ending):
    weights, wanted = import_checkpoint(part(prefix, ending)), random_weights()
    assert set(weights) == {*SHAPES, TRAINED}
    assert all(array.dtype == np.float32 for array in weights.values())
    for name in SHAPES:
        np.testing.assert_array_equal(weights[name], wanted[name])
    np.testing.assert_allclose(weights[TRAINED][0], (0.3, 2.0))  # v_max [m/s]


def test_a_file_that_is_absent_or_no_table(prefix, tmp_path, says):
    assert "cannot be read" in refused(import_checkpoint, tmp_path / "other")
    part(prefix, INDEX).write_bytes(b"PK" * 100)
    says(refused(import_checkpoint, prefix))


def test_a_shard_that_is_absent_or_cut_off(prefix):
    whole = part(prefix, SHARD).read_bytes()
    part(prefix, SHARD).write_bytes(whole[:-5])
    assert "beyond the end" in refused(import_checkpoint, prefix)
    part(prefix, SHARD).unlink()
    assert "cannot be read" in refused(import_checkpoint, prefix)


def test_the_checkpoint_of_another_network_is_refused(tmp_path, says):
    other = {**random_weights(), "dense_1.bias": np.zeros(100, np.float32)}
    says(refused(import_checkpoint, checkpoint(tmp_path / "other", other)))
    part(tmp_path / "none", INDEX).write_bytes(table({b"": b"\x08\x01"}))
    assert "main/pi/Variable is missing" in refused(import_checkpoint, tmp_path / "none")


def test_weights_that_are_not_finite_are_refused(tmp_path):
    weights = {**random_weights(), "alpha": np.array(np.nan, np.float32)}
    assert "not finite" in refused(import_checkpoint, checkpoint(tmp_path / "nan", weights))


@pytest.mark.parametrize(
    "entry",
    [
        (1, (32,), 0, 2**62),
        (1, (32,), 2**62, 128),
        (3, (32,), 0, 128),
    ],
)
def test_an_entry_that_lies(tmp_path, entry, says):
    tracemalloc.start()
    message = refused(import_checkpoint, checkpoint(tmp_path / "lies", random_weights(), {BIAS: entry}))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    says(message)
    assert peak < 2**24


@pytest.mark.parametrize("shape", [(2**62, 2**62), (0, 2**69), (1,) * 100])
def test_a_shape_that_lies_about_a_critic(tmp_path, shape):
    size = 0 if 0 in shape else 4 if set(shape) == {1} else 12
    changed = {"main/values/q1/dense/bias": (1, shape, 0, size)}
    refused(import_checkpoint, checkpoint(tmp_path / "lies", random_weights(), changed))


def test_a_wrong_checksum_of_a_tensor(tmp_path):
    assert "checksum is wrong" in refused(
        import_checkpoint, checkpoint(tmp_path / "crc", random_weights(), crc=1)
    )


@pytest.mark.parametrize("header", [b"\x08\x02", b"\x08\x01\x10\x01", b"\x0b"])
def test_a_bundle_of_another_kind(tmp_path, header):
    refused(import_checkpoint, checkpoint(tmp_path / "kind", random_weights(), header=header))


def test_compressed_blocks_are_refused(tmp_path):
    part(tmp_path / "snappy", INDEX).write_bytes(table({b"": b"\x08\x01"}, kind=1))
    assert "compressed" in refused(import_checkpoint, tmp_path / "snappy")


def test_no_damage_passes_and_none_gives_a_traceback(prefix):
    """Flipped bytes and cut ends: an error, or where the byte has no meaning, the right weights."""
    rng, wanted, harmless = np.random.default_rng(0), random_weights(), 0
    message = ""
    for ending in (INDEX, SHARD):
        whole = part(prefix, ending).read_bytes()
        for _ in range(150):
            damaged = bytearray(whole)
            damaged[rng.integers(len(whole))] ^= int(rng.integers(1, 256))
            if rng.random() < 0.2:
                damaged = damaged[: rng.integers(len(whole))]
            part(prefix, ending).write_bytes(bytes(damaged))
            try:
                found = import_checkpoint(prefix)
            except InputError as raised:
                message = str(raised)
            else:
                harmless += 1
                assert all((found[name] == wanted[name]).all() for name in SHAPES)
            assert "\n" not in message
        part(prefix, ending).write_bytes(whole)
    assert harmless < 15  # bytes of the footer that pad it


def test_noise_in_place_of_entries_never_gives_a_traceback(tmp_path):
    """Blocks with the right checksums that hold anything."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        keys = sorted({rng.bytes(rng.integers(0, 9)) for _ in range(4)} | {BIAS.encode()})
        entries = {key: rng.bytes(rng.integers(0, 30)) for key in keys}
        part(tmp_path / "noise", INDEX).write_bytes(table(entries))
        refused(import_checkpoint, tmp_path / "noise")


@pytest.mark.skipif(REAL is None, reason="DCLP_CHECKPOINT does not name the published checkpoint")
def test_the_published_checkpoint(tmp_path):
    prefix = Path(REAL)
    assert len(read_entries(prefix)) == 88
    weights = import_checkpoint(prefix)
    assert sum(array.size for array in weights.values()) == 80309
    assert float(weights["alpha"]) == pytest.approx(-0.0119, abs=1e-4)
    seen = np.empty((90, 6))
    angles = np.arange(90) * np.deg2rad(4)
    seen[:, 0], seen[:, 1], seen[:, 2] = np.cos(angles), np.sin(angles), 5.0
    seen[:, 3:] = 0.21, 0.21, 0.2128
    state = np.array([8.0, 0.0, 1.0, 0.0, 2.0, 1.57, 3.0, 3.0])
    network = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, weights)
    _, means = network.answer(seen, state)
    assert means[:, 0].min() > 0.5  # with nothing around, it drives ahead,
    state[1] = 1.0
    assert network.answer(seen, state)[1][:, 1].mean() > 0.5  # and turns left to a target there


@pytest.mark.parametrize(
    ("data", "checksum"),
    [
        (b"", 0),
        (b"123456789", 0xE3069283),
        (bytes(32), 0x8A9136AA),  # RFC 3720, appendix B.4, like the next two
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
    ],
)
def test_the_published_checksums_come_out(data, checksum):
    assert crc32c(data) == checksum


@given(st.binary(max_size=100))
def test_equals_the_checksum_bit_by_bit(data):
    assert crc32c(data) == oracles.crc32c(data)
