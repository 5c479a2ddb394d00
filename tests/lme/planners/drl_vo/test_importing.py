"""Import of an archive of Stable-Baselines3: what it reads, and what it refuses. The authors' own is not part of it."""

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from lme.errors import InputError
from lme.inputs.onnx_file import TRAINED
from lme.planners.drl_vo.importing import PICKLE_MAX, import_archive
from lme.planners.drl_vo.weights import Sizes, shapes
from tests.networks import TINY, random_drl_vo, refused
from tests.torch_archives import FLOAT, REBUILD, archive, name_of, number, state, tensor, text, zipped

REAL = os.environ.get("DRL_VO_ARCHIVE")
BIAS = "action_net.bias"  # (2,)
WEIGHTS = {name: array for name, array in random_drl_vo().items() if name != TRAINED}
KEY = str(list(WEIGHTS).index(BIAS))  # of its numbers


def test_the_actors_tensors_come_back(tmp_path):
    weights = import_archive(archive(tmp_path / "drl_vo.zip", WEIGHTS))
    assert list(weights) == [*shapes(TINY), TRAINED]
    assert weights.pop(TRAINED).tolist() == [0.5, 2.0]
    for name, array in weights.items():
        assert array.dtype == np.float32
        np.testing.assert_array_equal(array, WEIGHTS[name])


def test_a_tensor_may_be_a_part_of_a_storage(tmp_path):
    hidden = "mlp_extractor.policy_net.0.bias"  # (4,)
    part = tensor(str(list(WEIGHTS).index(hidden)), (2,), offset=1)
    weights = import_archive(archive(tmp_path / "drl_vo.zip", WEIGHTS, changed={BIAS: part}))
    np.testing.assert_array_equal(weights[BIAS], WEIGHTS[hidden][1:3])


def test_a_file_that_is_absent_or_no_archive(tmp_path, says):
    assert "cannot be read" in refused(import_archive, tmp_path / "none.zip")
    assert "is a directory" in refused(import_archive, tmp_path)
    (tmp_path / "text.zip").write_text("weights")
    says(refused(import_archive, tmp_path / "text.zip"))
    (tmp_path / "empty.zip").write_bytes(zipped({"data": b"{}"}))
    assert "holds no policy.pth" in refused(import_archive, tmp_path / "empty.zip")
    (tmp_path / "old.zip").write_bytes(zipped({"policy.pth": zipped({"version": b"3"})}))
    assert "PyTorch 1.6 or newer" in refused(import_archive, tmp_path / "old.zip")


def test_the_archive_of_another_network_is_refused(tmp_path, says):
    missing = {name: array for name, array in WEIGHTS.items() if name != "log_std"}
    assert "log_std is missing" in refused(import_archive, archive(tmp_path / "a.zip", missing))
    other = {**WEIGHTS, BIAS: np.zeros(3, np.float32)}
    says(refused(import_archive, archive(tmp_path / "b.zip", other)))


def test_weights_that_are_not_finite_are_refused(tmp_path, says):
    says(
        refused(
            import_archive, archive(tmp_path / "nan.zip", {**WEIGHTS, BIAS: np.full(2, np.nan, np.float32)})
        )
    )


@pytest.mark.parametrize(
    "pickled",
    [
        tensor(KEY, (2,), kind="torch LongStorage"),
        tensor(KEY, (2,), stride=(2,)),
        tensor(KEY, (2,), stride=(1, 1)),
        tensor(KEY, (2,), offset=1),
        tensor(KEY, (2,), offset=2**60),
        tensor(KEY, (2,), offset=-1),
        tensor("../../data", (2,)),
        tensor(KEY, (2**40,)),
        number(1),
    ],
)
def test_a_tensor_that_lies(tmp_path, pickled, says):
    path = archive(tmp_path / "lies.zip", WEIGHTS, changed={BIAS: pickled})
    tracemalloc.start()
    message = refused(import_archive, path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    says(message)
    assert peak < 2**24


@pytest.mark.parametrize(
    "pickle",
    [
        b"cos\nsystem\n(X\x04\0\0\0truetR.",
        state({"a": name_of("builtins eval") + b"(" + text("1") + b"tR"}),
        state({"a": tensor("0", (1,), rebuild="torch._utils _rebuild_parameter")}),
        state({"a": tensor("0", (1,), kind="torch._C Storage")}),
        state({"a": name_of(FLOAT) + b")R"}),
        state({"a": name_of(REBUILD) + b"(" + number(1) + b"tR"}),
        b"\x80\x02)" + b"\x85" * 10_000 + b"K\x01s.",
        b"\x80\x02}" + number(1) + number(2) + b"s.",
        b"\x80\x02Nr\xff\xff\xff\x7f.",
        b"\x80\x02K\x01r\xff\xff\xff\x7f.",
        b"\x80\x05\x96" + (2**50).to_bytes(8, "little") + b".",
        b"\x80\x02t.",
        b"\x80\x02\x85.",
        b"\x80\x02Q.",
        b"\x80\x02K\x01Q.",
        b"\x80\x02.",
        b"\x80\x02}",
        b"}" * (PICKLE_MAX + 1),
        b"\xff",
    ],
    ids=lambda pickle: repr(pickle[:24]),
)
def test_a_pickle_that_describes_no_state_is_read_as_data_only(tmp_path, pickle):
    tracemalloc.start()
    message = refused(import_archive, archive(tmp_path / "hostile.zip", WEIGHTS, pickle=pickle))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "is not an archive of a DRL-VO network" in message
    assert peak < 2**25


def test_numbers_that_are_missing(tmp_path):
    message = refused(
        import_archive, archive(tmp_path / "cut.zip", WEIGHTS, left_out=[f"archive/data/{KEY}"])
    )
    assert f"holds no archive/data/{KEY}" in message


def test_no_damage_passes_and_none_gives_a_traceback(tmp_path):
    """Flipped bytes and cut ends: an error, or where the byte has no meaning, the right weights."""
    whole = archive(tmp_path / "whole.zip", WEIGHTS).read_bytes()
    rng, path = np.random.default_rng(0), tmp_path / "damaged.zip"
    for i in range(300):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole) * (i % 2) // 2, len(whole))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged if i % 5 else damaged[: rng.integers(len(whole))]))
        message = ""
        try:
            found = import_archive(path)
        except InputError as raised:
            message = str(raised)
        else:
            assert all((found[name] == WEIGHTS[name]).all() for name in found)
        assert "\n" not in message


def test_noise_in_place_of_the_pickle_never_gives_a_traceback(tmp_path):
    rng, good = np.random.default_rng(1), state({"a": tensor("0", (2, 2))})
    for _ in range(200):
        pickle = bytearray(good)
        for _ in range(3):
            pickle[rng.integers(2, len(good))] = int(rng.integers(256))
        refused(import_archive, archive(tmp_path / "noise.zip", {}, pickle=bytes(pickle)))


@pytest.mark.skipif(REAL is None, reason="DRL_VO_ARCHIVE does not name the published archive")
def test_the_published_archive():
    weights = import_archive(Path(REAL))
    assert {name: array.shape for name, array in weights.items()} == shapes(Sizes(64, 256, 256))
