"""MAER-Nav and DRL-NSUO: local planners of one laboratory, trained by reinforcement learning.

Their networks have an adaptive reciprocal (IPAPRec): the nearest returns of the sectors enter as 1 / (d + α), with α
learned; with the state, they pass through four layers to the mean of the action. MAER-Nav has 32 sectors. DRL-NSUO has
30, whose inputs are in shares of that of 0.2 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.errors import argument_error, require
from lme.inputs.onnx_file import Arrays, Shape, Signature, SignedNetwork
from lme.inputs.onnx_graph import OnnxGraph
from lme.planners.commands import limited
from lme.planners.dclp.importing import read_policy
from lme.planners.drl_vo.observation import binned, has_return
from lme.robots import Robot
from lme.types import Floats, Guidance, LaserScan, Observation, Twist

STATE_INPUTS = 4  # distance and bearing of the target, v, ω
LAYERS = ("hidden_1", "hidden_2", "hidden_3", "hidden_4", "mean")
_WIDTH, _ACTIONS = 100, 2
_SLOPE = 0.2  # of the leaky ReLU, TensorFlow's default
_LEAST_DISTANCE = 1e-8  # [m] of distance plus α
_POLICY = "main/pi"  # the scope of the policy; the checkpoint also has critics and target networks
_CHECKPOINT_LAYERS = ("dense", "dense_1", "dense_2", "dense_3", "dense_4")  # dense_5 has the deviations


@dataclass(slots=True)
class IpapRecConfig:
    """Network, its view of the scan, and the velocities for its output."""

    weights: str | None
    sectors: int
    fov: float
    no_return: float
    v_min: float
    v_max: float
    omega_max: float

    def __post_init__(self) -> None:
        require("sectors", self.sectors, at_least=1)
        for key in ("fov", "no_return", "v_max", "omega_max"):
            require(key, getattr(self, key), above=0.0)
        require("fov", self.fov, at_most=math.tau)
        require("v_min", self.v_min, at_most=0.0)


class IpapRec:
    """MAER-Nav (arXiv 2503.23908) and DRL-NSUO, the network alone.

    Network, observation and action are those of the authors' code; the action is the mean of the policy, without noise.
    The network drives to the guide's subgoal. It is given the speed without its sign, and has no notion of arrival. The
    command is limited to what the robot can reach in a period.
    """

    Config = IpapRecConfig

    def __init__(self, config: IpapRecConfig, robot: Robot) -> None:
        if config.weights is None:
            raise argument_error(
                "weights is null: the authors' networks do not ship with lme; import one with "
                "`lme weights import maer_nav PATH` or `lme weights import drl_nsuo PATH`"
            )
        self._network = SignedNetwork(Path(config.weights), signature(config.sectors))
        self._config = config
        self._robot = robot

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; there is nothing to forget, and `rng` is not used."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config = self._config
        ranges = nearest_by_sector(observation.scan, self._robot.lidar.yaw, config)
        x, y = guidance.subgoal
        v, omega = observation.twist
        state = np.array([math.hypot(x, y), math.atan2(y, x), abs(v), omega])
        (mean,) = self._network.answer(ranges, state)
        forward, turn = mean.tolist()
        v = config.v_min + (forward + 1.0) / 2.0 * (config.v_max - config.v_min)
        return limited(v, turn * config.omega_max, observation, self._robot.dt)


def nearest_by_sector(scan: LaserScan, mount_yaw: float, config: IpapRecConfig) -> Floats:
    """Nearest return in each sector about the lidar, from the right to the left: (sectors,) [m]."""
    first, count = scan.angle_min + mount_yaw, len(scan.ranges)
    beams, sectors = binned(first, scan.angle_increment, count, config.fov, config.sectors)
    nearest = np.full(config.sectors, config.no_return)
    ranges = np.where(has_return(scan), np.minimum(scan.ranges, config.no_return), config.no_return)
    np.minimum.at(nearest, sectors, ranges[beams])
    return nearest


def shapes(sectors: int) -> dict[str, Shape]:
    """Return the shape of every array by its name; a kernel is (inputs, outputs)."""
    widths = (sectors + STATE_INPUTS, *[_WIDTH] * 4, _ACTIONS)
    found: dict[str, Shape] = {"alpha": ()}
    for layer, rows, columns in zip(LAYERS, widths[:-1], widths[1:], strict=True):
        found |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return found


def signature(sectors: int) -> Signature:
    """Return the interface of a network."""
    what = f"an IPAPRec network of {sectors} sectors"
    return Signature("ipaprec", what, {"ranges": (sectors,), "state": (STATE_INPUTS,)}, {"mean": (_ACTIONS,)})


def write_weights(weights: Arrays, file: IO[bytes], unit: float | None = None) -> None:
    """Write the arrays of `shapes` as an ONNX file. The same weights give the same bytes.

    unit: distance [m] whose reciprocal becomes 1; None: reciprocals in 1/m.
    """
    sectors = len(weights["hidden_1.kernel"]) - STATE_INPUTS
    graph = OnnxGraph({name: weights[name] for name in shapes(sectors)})
    reciprocal = graph.node("Reciprocal", _shifted(graph, "ranges"))
    if unit is not None:
        reciprocal = graph.node("Mul", reciprocal, _shifted(graph, graph.constant(unit)))
    x = graph.reshape(graph.node("Concat", reciprocal, "state", axis=0), 1, -1)
    for layer in LAYERS[:-1]:
        x = graph.leaky(x, layer, _SLOPE)
    mean = graph.linear(x, LAYERS[-1])
    graph.reshape(graph.node("Tanh", mean), _ACTIONS, output="mean")
    file.write(graph.model(signature(sectors)))


def _shifted(graph: OnnxGraph, distance: str) -> str:
    return graph.node("Max", graph.node("Add", distance, "alpha"), graph.constant(_LEAST_DISTANCE))


def tensor_names() -> dict[str, str]:
    """Return the checkpoint's name of every array of `shapes`."""
    names = {"alpha": f"{_POLICY}/Variable"}
    for ours, theirs in zip(LAYERS, _CHECKPOINT_LAYERS, strict=True):
        names |= {f"{ours}.{part}": f"{_POLICY}/{theirs}/{part}" for part in ("kernel", "bias")}
    return names


def import_checkpoint(path: Path, sectors: int) -> dict[str, NDArray[np.float32]]:
    """Return the arrays of `shapes` in a TensorFlow V2 checkpoint. path: as for `read_policy`; raises its errors."""
    return read_policy(path, tensor_names(), shapes(sectors), signature(sectors).what)
