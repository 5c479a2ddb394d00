"""MAER-Nav and DRL-NSUO with random weights: the network by hand, what it is given, and what its answer means."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.inputs.onnx_file import SignedNetwork
from lme.inputs.onnx_graph import read_weights
from lme.planners.ipaprec import (
    LAYERS,
    IpapRec,
    import_checkpoint,
    nearest_by_sector,
    shapes,
    signature,
    tensor_names,
    write_weights,
)
from lme.types import Guidance, LaserScan, Twist
from tests import oracles
from tests.builders import observation, stage
from tests.networks import checkpoint, ipaprec_file, network_file, random_ipaprec, refused
from tests.tolerances import KERNEL, NETWORK

ROBOT = stage(v_max=3.0, omega_max=3.0, alpha_v=100.0, alpha_omega=100.0)  # reaches any command in a period


class Recorder:
    """A network that keeps what it is given and always answers the same."""

    def __init__(self, mean):
        self._mean = np.array(mean)

    def answer(self, ranges, state):
        self.ranges, self.state = ranges, state
        return [self._mean]


def made(tmp_path, mean=(0.5, -0.25), name="maer_nav"):
    file = ipaprec_file(tmp_path / "w.onnx", load_settings(f"planner/{name}").sectors)
    planner = IpapRec(load_settings(f"planner/{name}", weights=str(file)), ROBOT)
    planner._network = network = Recorder(mean)
    return planner, network


@pytest.mark.parametrize(("sectors", "unit"), [(32, None), (30, 0.2)])
def test_the_network_by_hand(tmp_path, sectors, unit):
    weights, rng = random_ipaprec(sectors), np.random.default_rng(1)
    with (tmp_path / "w.onnx").open("wb") as file:
        write_weights(weights, file, unit)
    ranges, state = rng.uniform(0.5, 5.0, sectors), rng.normal(size=4)
    x = 1.0 / (ranges + weights["alpha"])
    if unit is not None:
        x *= unit + weights["alpha"]
    x = np.concatenate((x, state))
    for layer in LAYERS:
        slope = 1.0 if layer == LAYERS[-1] else 0.2
        x = oracles.dense(x, weights[f"{layer}.kernel"], weights[f"{layer}.bias"], slope)
    (mean,) = SignedNetwork(tmp_path / "w.onnx", signature(sectors)).answer(ranges, state)
    assert mean == pytest.approx(np.tanh(x), abs=NETWORK)
    assert np.abs(x).max() < 2.0, "tanh is not saturated"


def test_a_distance_below_the_least_counts_as_the_least(tmp_path):
    weights = {**random_ipaprec(), "alpha": np.array(-0.5, np.float32)}
    with (tmp_path / "w.onnx").open("wb") as file:
        write_weights(weights, file)
    network, state = SignedNetwork(tmp_path / "w.onnx", signature(32)), np.zeros(4)
    near, nearer = (network.answer(np.full(32, distance), state)[0] for distance in (0.5, 0.1))
    np.testing.assert_array_equal(near, nearer)


def test_each_sector_has_its_nearest_return_from_the_right_to_the_left():
    ranges = np.full(720, np.inf, np.float32)
    ranges[[0, 359, 360, 719]] = 1.0, 2.0, 3.0, np.nan
    scan = LaserScan(ranges, -math.pi, math.tau / 720, 0.1, 30.0)
    seen = nearest_by_sector(scan, 0.0, load_settings("planner/maer_nav"))
    assert (seen[0], seen[15], seen[16], seen[31]) == (1.0, 2.0, 3.0, 20.0)
    assert (np.delete(seen, [0, 15, 16]) == 20.0).all()
    ahead = nearest_by_sector(
        scan, 0.0, load_settings("planner/maer_nav", sectors=30, fov=math.radians(270.0))
    )
    assert (ahead[14], ahead[15]) == (2.0, 3.0)
    assert 1.0 not in ahead, "straight back is out of view"


def test_the_network_gets_distance_bearing_and_speed_without_its_sign(tmp_path):
    planner, network = made(tmp_path)
    planner.plan(observation(twist=Twist(-0.3, -0.1), robot=ROBOT), Guidance(np.array([0.0, 2.0])))
    assert network.state == pytest.approx([2.0, math.pi / 2, 0.3, -0.1])
    assert network.ranges.shape == (32,)


@pytest.mark.parametrize(
    ("name", "mean", "command"),
    [
        ("maer_nav", (1.0, 1.0), (0.5, math.pi / 2)),
        ("maer_nav", (-1.0, -0.5), (-0.5, -math.pi / 4)),
        ("drl_nsuo", (1.0, 1.0), (2.0, math.pi / 3)),
        ("drl_nsuo", (-1.0, 0.0), (0.0, 0.0)),
    ],
)
def test_the_output_is_scaled_to_the_authors_velocities(tmp_path, name, mean, command):
    planner, _ = made(tmp_path, mean, name)
    assert planner.plan(observation(robot=ROBOT), Guidance(np.array([4.0, 0.0]))) == pytest.approx(
        command, abs=KERNEL
    )


def test_an_imported_checkpoint_has_the_policy_s_weights(tmp_path):
    weights = random_ipaprec(30)
    prefix = checkpoint(tmp_path / "model-15", weights, names=tensor_names())
    found = import_checkpoint(prefix, 30)
    assert list(found) == list(shapes(30))
    with (tmp_path / "w.onnx").open("wb") as file:
        write_weights(found, file, 0.2)
    again = read_weights(tmp_path / "w.onnx", "a network")
    for name, array in weights.items():
        np.testing.assert_array_equal(again[name], array)
    message = refused(lambda path: import_checkpoint(path, 32), prefix)
    assert (
        "main/pi/dense/kernel has the shape (34, 100): an IPAPRec network of 32 sectors has one of (36, 100)"
        in message
    )


def test_missing_weights_and_those_of_another_network_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"weights is null: .*lme weights import maer_nav PATH"):
        IpapRec(load_settings("planner/maer_nav", weights=None), ROBOT)
    for path, says in (
        (
            network_file(tmp_path / "dclp.onnx"),
            "is of the kind 'dclp': must be an IPAPRec network of 32 sectors",
        ),
        (ipaprec_file(tmp_path / "nsuo.onnx", 30), r"takes .*30.*must be an IPAPRec network of 32 sectors"),
    ):
        with pytest.raises(InputError, match=says):
            IpapRec(load_settings("planner/maer_nav", weights=str(path)), ROBOT)
