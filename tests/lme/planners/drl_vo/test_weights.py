import numpy as np
import pytest

from lme.errors import InputError
from lme.planners.drl_vo.architecture import Sizes, shapes
from lme.planners.drl_vo.weights import file_shapes, read_weights, write_weights
from tests.networks import drl_vo_file, random_drl_vo, refused

BIAS = "features_extractor.conv2_2.3.bias"


def test_the_published_network_has_2_6_million_parameters():
    sizes = shapes(Sizes(64, 256, 256))
    statistics = sum(
        np.prod(shape) for name, shape in sizes.items() if name.endswith(("running_mean", "running_var"))
    )
    parameters = sum(np.prod(shape) for shape in sizes.values()) - statistics
    assert parameters / 1e6 == pytest.approx(2.6, abs=0.05)
    assert sizes["features_extractor.linear_fc.0.weight"] == (256, 514)


@pytest.mark.parametrize("sizes", [Sizes(2, 5, 4), Sizes(8, 16, 24), Sizes(1, 1, 1)])
def test_networks_of_any_size_come_back(tmp_path, sizes):
    wanted, path = random_drl_vo(sizes), tmp_path / "w.npz"
    with path.open("wb") as file:
        write_weights({**wanted, "value_net.bias": np.zeros(1, np.float32)}, file)
    weights = read_weights(path)
    assert list(weights) == list(file_shapes(sizes))
    assert all((weights[name] == wanted[name]).all() for name in weights)


def test_the_same_weights_give_the_same_bytes(tmp_path):
    first, second = (drl_vo_file(tmp_path / f"{name}.npz").read_bytes() for name in "ab")
    assert first == second


def test_writing_needs_every_array():
    weights = random_drl_vo()
    del weights[BIAS]
    with pytest.raises(InputError, match=rf"weights: {BIAS} is missing"):
        write_weights(weights, None)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        (BIAS, np.zeros(3, np.float32)),
        ("features_extractor.conv1.weight", np.zeros((3, 3, 3, 3), np.float32)),
        ("features_extractor.conv1.weight", np.zeros((), np.float32)),
        ("features_extractor.conv1.weight", np.zeros((0, 3, 3, 3), np.float32)),
        (BIAS, np.zeros(4)),
        (BIAS, np.full(4, np.nan, np.float32)),
    ],
)
def test_arrays_that_do_not_fit(tmp_path, name, array, says):
    np.savez(tmp_path / "w.npz", **{**random_drl_vo(), name: array})
    says(refused(read_weights, tmp_path / "w.npz"))


def test_a_file_of_something_else_is_refused(tmp_path, says):
    assert "cannot be read" in refused(read_weights, tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("weights")
    says(refused(read_weights, tmp_path / "text.npz"))
    whole = drl_vo_file(tmp_path / "w.npz").read_bytes()
    (tmp_path / "w.npz").write_bytes(whole[: len(whole) // 2])
    refused(read_weights, tmp_path / "w.npz")


def test_no_damage_gives_a_traceback(tmp_path):
    whole = drl_vo_file(tmp_path / "w.npz").read_bytes()
    rng, path, message = np.random.default_rng(0), tmp_path / "damaged.npz", ""
    for _ in range(100):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged))
        try:
            read_weights(path)
        except InputError as raised:
            message = str(raised)
        assert "\n" not in message
