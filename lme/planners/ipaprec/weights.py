"""Layers of a network with an adaptive reciprocal (IPAPRec), and its weights in an ONNX file.

The nearest returns of the sectors enter as 1 / (d + α), with α learned; with the state, they pass through four layers
to the mean of the action. MAER-Nav has 32 sectors. DRL-NSUO has 30, whose inputs are in shares of that of 0.2 m.
"""

from __future__ import annotations

from typing import IO

from lme.inputs.onnx_file import Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph

STATE_INPUTS = 4  # distance and bearing of the target, v, ω
LAYERS = ("hidden_1", "hidden_2", "hidden_3", "hidden_4", "mean")
_WIDTH, _ACTIONS = 100, 2
_SLOPE = 0.2  # of the leaky ReLU, TensorFlow's default
_LEAST_DISTANCE = 1e-8  # [m] of distance plus α


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
