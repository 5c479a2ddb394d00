import io

import numpy as np
import pytest

from lme.errors import InputError
from lme.planners.drl_vo.weights import Sizes, read_weights, shapes, write_weights
from tests.networks import drl_vo_file, network_file, random_drl_vo, refused

BIAS = "features_extractor.conv2_2.3.bias"


def test_the_published_network_has_2_6_million_parameters():
    sizes = shapes(Sizes(64, 256, 256))
    statistics = sum(
        np.prod(shape) for name, shape in sizes.items() if name.endswith(("running_mean", "running_var"))
    )
    parameters = sum(np.prod(shape) for shape in sizes.values()) - statistics
    assert parameters / 1e6 == pytest.approx(2.6, abs=0.05)
    assert sizes["features_extractor.linear_fc.0.weight"] == (256, 514)


@pytest.mark.parametrize("batch_norm", ["sample", "running"])
@pytest.mark.parametrize("sizes", [Sizes(2, 5, 4), Sizes(8, 16, 24), Sizes(1, 1, 1)])
def test_networks_of_any_size_come_back(tmp_path, sizes, batch_norm):
    wanted, path = random_drl_vo(sizes), tmp_path / "w.onnx"
    with path.open("wb") as file:
        write_weights({**wanted, "value_net.bias": np.zeros(1, np.float32)}, file, batch_norm)
    weights = read_weights(path)
    assert list(weights) == list(shapes(sizes))
    assert all((weights[name] == wanted[name]).all() for name in weights)


def test_the_same_weights_give_the_same_bytes(tmp_path):
    first, second = (drl_vo_file(tmp_path / f"{name}.onnx").read_bytes() for name in "ab")
    assert first == second


def test_writing_needs_every_array():
    weights = random_drl_vo()
    del weights[BIAS]
    with pytest.raises(InputError, match=rf"weights: {BIAS} is missing"):
        write_weights(weights, io.BytesIO())


@pytest.mark.parametrize(
    ("name", "array", "says"),
    [
        (
            BIAS,
            np.zeros(3, np.float32),
            "must be (4,) in a DRL-VO network of 2 channels, 5 features and 4 hidden",
        ),
        ("features_extractor.conv1.weight", np.zeros((3, 3, 3, 3), np.float32), "network of 3 channels"),
        ("features_extractor.conv1.weight", np.zeros((), np.float32), "must have 1 to"),
        ("features_extractor.conv1.weight", np.zeros((0, 3, 3, 3), np.float32), "must have 1 to"),
    ],
)
def test_arrays_that_do_not_fit(name, array, says):
    with pytest.raises(InputError) as caught:
        write_weights({**random_drl_vo(), name: array}, io.BytesIO())
    assert says in str(caught.value)


def test_a_file_of_another_network_is_refused(tmp_path):
    path = network_file(tmp_path / "w.onnx")
    assert "conv1.weight is missing: must hold the weights of a DRL-VO network" in refused(read_weights, path)
