"""Layers of a subgoal network, and its weights in an ONNX file: two hidden layers, and a logit for every candidate."""

from __future__ import annotations

import math
from typing import IO

from lme.guides.learned_subgoal.candidates import BEARINGS, CANDIDATES, RANGES
from lme.inputs.onnx_file import TRAINED, Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph

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
