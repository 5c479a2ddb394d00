"""The subgoal network: the candidates that it chooses from, its layers, its weights in an ONNX file, and the draw.

Candidate b · len(RANGES) + r lies `RANGES[r]` away at the bearing 2π b / BEARINGS, counter-clockwise from ahead. Two
hidden layers give a logit for every candidate.
"""

from __future__ import annotations

import math
from typing import IO

import numpy as np

from lme.inputs.onnx_file import TRAINED, Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph
from lme.types import Floats, Ints

BEARINGS = 48
RANGES = (0.4, 0.8, 1.6, 3.2)  # [m] ASSUMED
CANDIDATES = BEARINGS * len(RANGES)
STATE_INPUTS = 11  # target 3, twist 2, limits 4, last subgoal 2
HIDDEN = (128, 128)  # ASSUMED
LAYERS = ("hidden_1", "hidden_2", "output")
SLOPE = 0.2  # of the leaky ReLU


def _shapes() -> dict[str, Shape]:
    widths = (2 * BEARINGS + STATE_INPUTS, *HIDDEN, CANDIDATES)
    shapes: dict[str, Shape] = {}
    for layer, rows, columns in zip(LAYERS, widths[:-1], widths[1:], strict=True):
        shapes |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return shapes


SHAPES = _shapes()  # of every array of the network by its name; a kernel is (inputs, outputs)
REPORTED = ("v_max", "omega_max", "alpha_v", "alpha_omega", "length", "width")  # of a robot, SI units
SIGNATURE = Signature(
    "learned_subgoal",
    "a subgoal network",
    {"scan": (BEARINGS,), "free": (CANDIDATES,), "state": (STATE_INPUTS,)},
    {"logits": (CANDIDATES,)},  # −inf for candidates that are not free
    (len(REPORTED), 2),  # lowest and highest values of REPORTED
)


def bearings() -> Floats:
    """Bearings of the grid [rad], in [0, 2π): (BEARINGS,)."""
    return np.arange(BEARINGS, dtype=np.float64) * (math.tau / BEARINGS)


def candidates() -> Floats:
    """All candidates in the robot frame [m]: (CANDIDATES, 2)."""
    directions = np.column_stack((np.cos(bearings()), np.sin(bearings())))
    grid: Floats = directions[:, None] * np.array(RANGES)[:, None]
    return grid.reshape(CANDIDATES, 2)


def mirrored_bearings() -> Ints:
    """Index that each bearing has with left and right swapped: (BEARINGS,)."""
    return -np.arange(BEARINGS) % BEARINGS


def write_weights(weights: Arrays, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` and `TRAINED` as an ONNX file. The same weights give the same bytes."""
    graph = OnnxGraph({name: weights[name] for name in SHAPES})
    ways = graph.node("ReduceMean", graph.reshape("free", BEARINGS, len(RANGES)), axes=[1], keepdims=0)
    x = graph.reshape(graph.node("Concat", "scan", ways, "state", axis=0), 1, -1)
    for layer in LAYERS[:-1]:
        x = graph.leaky(x, layer, SLOPE)
    output = graph.reshape(graph.linear(x, LAYERS[-1]), CANDIDATES)
    is_free = graph.node("Greater", "free", graph.constant(0.0))
    graph.node("Where", is_free, output, graph.constant(-math.inf), output="logits")
    file.write(graph.model(SIGNATURE, weights[TRAINED]))


def draw(logits: Floats, rng: np.random.Generator) -> int:
    """Draw a candidate by its probability. logits: (CANDIDATES,), −inf for candidates that must not be drawn."""
    odds = np.cumsum(np.exp(logits - logits.max()))
    return int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))
