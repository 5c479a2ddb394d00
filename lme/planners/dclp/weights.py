"""Layers of a DCLP network, and its weights in an ONNX file.

A direction's inputs pass through three layers that all directions share, of which the largest outputs count; with the
state, they pass through four further layers to a mixture of actions.
"""

from __future__ import annotations

from typing import IO

from lme.inputs.onnx_file import TRAINED, Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph

DIRECTIONS, DIRECTION_INPUTS, STATE_INPUTS = 90, 6, 8
COMPONENTS, MIXTURE = 4, 5  # of the mixture; logit, mean (2) and log deviation (2) of each
CONVOLUTIONS, HIDDEN = (32, 64, 128), (128, 128, 128, 128)
LAYERS = (*(f"convolution_{i}" for i in (1, 2, 3)), *(f"dense_{i}" for i in (1, 2, 3, 4)), "output")
SLOPE = 0.2  # of the leaky ReLU, TensorFlow's default
LEAST_DISTANCE = 1e-8  # [m] of distance plus α
DISTANCE = 2  # column of the distance in a direction's inputs


def _shapes() -> dict[str, Shape]:
    inputs = (DIRECTION_INPUTS, *CONVOLUTIONS[:-1], CONVOLUTIONS[-1] + STATE_INPUTS, *HIDDEN)
    outputs = (*CONVOLUTIONS, *HIDDEN, COMPONENTS * MIXTURE)
    shapes: dict[str, Shape] = {"alpha": ()}
    for layer, rows, columns in zip(LAYERS, inputs, outputs, strict=True):
        shapes |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return shapes


SHAPES = _shapes()  # of every array of the network by its name; a kernel is (inputs, outputs)
# Of a robot, in SI units.
REPORTED = ("v_max", "omega_max", "alpha_v", "alpha_omega", "front", "rear", "half_width")
SIGNATURE = Signature(
    "dclp",
    "a DCLP network",
    {"directions": (DIRECTIONS, DIRECTION_INPUTS), "state": (STATE_INPUTS,)},
    {"logits": (COMPONENTS,), "means": (COMPONENTS, 2)},
    (len(REPORTED), 2),  # lowest and highest values of REPORTED
)


def write_weights(weights: Arrays, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` and `TRAINED` as an ONNX file. The same weights give the same bytes."""
    graph = OnnxGraph({name: weights[name] for name in SHAPES})
    # The distance d enters as 1 / (d + α), with α learned.
    distance = graph.node("Add", graph.columns("directions", DISTANCE, DISTANCE + 1), "alpha")
    inverse = graph.node("Reciprocal", graph.node("Max", distance, graph.constant(LEAST_DISTANCE)))
    before = graph.columns("directions", 0, DISTANCE)
    after = graph.columns("directions", DISTANCE + 1, DIRECTION_INPUTS)
    x = graph.node("Concat", before, inverse, after, axis=1)
    for layer in LAYERS[:-1]:
        if layer == "dense_1":
            nearest = graph.node("ReduceMax", x, axes=[0], keepdims=1)
            x = graph.node("Concat", nearest, graph.reshape("state", 1, STATE_INPUTS), axis=1)
        x = graph.leaky(x, layer, SLOPE)
    output = graph.linear(x, LAYERS[-1])
    mixture = graph.reshape(output, COMPONENTS, MIXTURE)
    graph.reshape(graph.columns(mixture, 0, 1), COMPONENTS, output="logits")
    graph.node("Tanh", graph.columns(mixture, 1, 3), output="means")
    file.write(graph.model(SIGNATURE, weights[TRAINED]))
