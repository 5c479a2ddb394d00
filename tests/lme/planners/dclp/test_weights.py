import zipfile

import numpy as np
import pytest

from lme.errors import InputError
from lme.planners.dclp.weights import SHAPES, TRAINED, read_weights, write_weights
from tests.networks import network_file, random_weights, refused


def saved(path, **changed):
    np.savez(path, **{**random_weights(), **changed})
    return path


def test_written_weights_come_back_and_the_bytes_are_the_same(tmp_path):
    first, second = (network_file(tmp_path / f"{name}.npz") for name in "ab")
    assert first.read_bytes() == second.read_bytes()
    weights, wanted = read_weights(first), random_weights()
    assert list(weights) == [*SHAPES, TRAINED]
    assert all((weights[name] == wanted[name]).all() for name in wanted)


def test_a_file_of_something_else_is_refused(tmp_path, says):
    assert "cannot be read" in refused(read_weights, tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("weights")
    says(refused(read_weights, tmp_path / "text.npz"))
    np.savez(tmp_path / "other.npz", weights=np.zeros(3))
    assert "alpha is missing" in refused(read_weights, tmp_path / "other.npz")


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((7, 32), np.float32), "must be float32 (6, 32)"),
        (np.zeros((6, 32)), "is float64"),
        (np.zeros((6, 32), np.float32, order="F"), "must be float32"),
        (np.array([{}], object), "must be float32"),
        (np.full((6, 32), np.inf, np.float32), "not finite"),
    ],
)
def test_an_array_of_another_kind(tmp_path, array, said):
    assert said in refused(read_weights, saved(tmp_path / "w.npz", **{"convolution_1.kernel": array}))


def test_a_member_that_is_large_or_cut_off(tmp_path):
    whole = network_file(tmp_path / "w.npz")
    torn = b"\x93NUMPY\x01\x00\x14\x00" + b"{'descr': ('<f4'".ljust(19) + b"\n"
    for content in (
        bytes(2**21),
        zipfile.ZipFile(whole).read("alpha.npy")[:-2],
        torn,
        b"\x93NUMPY\x01\x00",
        b"",
    ):
        path = tmp_path / "changed.npz"
        for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            with zipfile.ZipFile(path, "w", method) as archive:
                archive.writestr("alpha.npy", content)
            refused(read_weights, path)


def test_no_damage_gives_a_traceback(tmp_path):
    whole = network_file(tmp_path / "w.npz").read_bytes()
    rng, path = np.random.default_rng(0), tmp_path / "damaged.npz"
    directory = len(whole) - 3000  # half of the damage to the zip's own directory at the end
    for i in range(200):
        damaged = bytearray(whole)
        damaged[rng.integers(directory if i % 2 else 0, len(whole))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged if i % 5 else damaged[: rng.integers(len(whole))]))
        message = ""
        try:
            read_weights(path)
        except InputError as raised:
            message = str(raised)
        assert "\n" not in message


def test_writing_needs_every_array(tmp_path):
    with pytest.raises(KeyError), (tmp_path / "w.npz").open("wb") as file:
        write_weights({}, file)
