"""Layers of the LiCS network, and its weights in an ONNX file.

The network reads a sweep as 36 tokens of 20 beams, and the direction of the goal as two tokens of one number. Names
and shapes are those of the authors' `state_dict`: three layers of an encoder, in which the tokens of the sweep attend
to each other, three of a decoder, in which those of the goal attend to them, and a head over both.
"""

from __future__ import annotations

from typing import IO

from lme.inputs.onnx_file import Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph

BEAMS, PATCHES, GOAL = 720, 36, 2
WIDTH, HEADS, HIDDEN, LAYERS = 32, 4, 256, 3
ENCODER, DECODER = ("encoder.layers", "self_attn"), ("decoder.layers", "encoder_attn")


def _shapes() -> dict[str, Shape]:
    shapes: dict[str, Shape] = {
        "encoder.embedding.pos_embed": (PATCHES, WIDTH),
        "encoder.embedding.linear.weight": (WIDTH, BEAMS // PATCHES),
        "encoder.embedding.linear.bias": (WIDTH,),
        "decoder.linear.weight": (WIDTH, 1),
        "decoder.linear.bias": (WIDTH,),
        "prediction_head.weight": (2, GOAL * WIDTH),
        "prediction_head.bias": (2,),
    }
    # Layers of the encoder and of the decoder: attention, two norms and two dense layers each.
    for stack, attention in (ENCODER, DECODER):
        for k in range(LAYERS):
            layer, norms = f"{stack}.{k}", (f"{attention}_layer_norm", "final_layer_norm")
            for name in ("k_proj", "v_proj", "q_proj", "out_proj"):
                shapes[f"{layer}.{attention}.{name}.weight"] = (WIDTH, WIDTH)
            for norm in norms:
                shapes |= {f"{layer}.{norm}.{name}": (WIDTH,) for name in ("weight", "bias")}
            forward = f"{layer}.PositionWiseFeedForward"
            shapes |= {f"{forward}.w_1.weight": (HIDDEN, WIDTH), f"{forward}.w_1.bias": (HIDDEN,)}
            shapes |= {f"{forward}.w_2.weight": (WIDTH, HIDDEN), f"{forward}.w_2.bias": (WIDTH,)}
    return shapes


SHAPES = _shapes()  # of every array of the network by its name; a weight is (outputs, inputs)
SIGNATURE = Signature(
    "lics",
    "a LiCS network",
    {"ranges": (BEAMS,), "direction": (GOAL,)},  # [m], from the right to the left; unit vector to the goal
    {"velocity": (2,)},  # shares of the greatest v and ω
)
_NORM_EPSILON = 1e-5  # PyTorch's default of a layer norm


def write_weights(weights: Arrays, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` as an ONNX file. The same weights give the same bytes."""
    graph = OnnxGraph({name: weights[name] for name in SHAPES})
    sweep = graph.linear(graph.reshape("ranges", PATCHES, BEAMS // PATCHES), "encoder.embedding.linear")
    sweep = graph.node("Add", sweep, "encoder.embedding.pos_embed")
    for k in range(LAYERS):
        sweep = _layer(graph, f"{ENCODER[0]}.{k}", ENCODER[1], sweep, sweep)
    goal = graph.linear(graph.reshape("direction", GOAL, 1), "decoder.linear")
    for k in range(LAYERS):
        goal = _layer(graph, f"{DECODER[0]}.{k}", DECODER[1], goal, sweep)
    velocity = graph.linear(graph.reshape(goal, 1, GOAL * WIDTH), "prediction_head")
    graph.reshape(velocity, 2, output="velocity")
    file.write(graph.model(SIGNATURE))


def _layer(graph: OnnxGraph, name: str, attention: str, tokens: str, attended: str) -> str:
    """Add attention to tokens, then two dense layers for each token, both with shortcuts and norms."""
    # Softmax of query · key / √W weighs the values; each head has its own part of the W columns. As in the authors'
    # code, the root is that of W, not of a head's width.
    sources = {"q": tokens, "k": attended, "v": attended}
    q, k, v = (
        graph.reshape(_product(graph, x, f"{name}.{attention}.{part}_proj"), -1, HEADS, WIDTH // HEADS)
        for part, x in sources.items()
    )
    q, v = (graph.node("Transpose", x, perm=[1, 0, 2]) for x in (q, v))
    scores = graph.node("MatMul", q, graph.node("Transpose", k, perm=[1, 2, 0]))
    shares = graph.node("Softmax", graph.node("Mul", scores, graph.constant(WIDTH**-0.5)), axis=-1)
    mixed = graph.node("Transpose", graph.node("MatMul", shares, v), perm=[1, 0, 2])
    mixed = _product(graph, graph.reshape(mixed, -1, WIDTH), f"{name}.{attention}.out_proj")
    tokens = _normed(graph, graph.node("Add", tokens, mixed), f"{name}.{attention}_layer_norm")
    forward = f"{name}.PositionWiseFeedForward"
    wide = graph.node("Relu", graph.linear(tokens, f"{forward}.w_1"))
    return _normed(
        graph, graph.node("Add", tokens, graph.linear(wide, f"{forward}.w_2")), f"{name}.final_layer_norm"
    )


def _product(graph: OnnxGraph, x: str, name: str) -> str:
    return graph.node("Gemm", x, f"{name}.weight", transB=1)


def _normed(graph: OnnxGraph, x: str, name: str) -> str:
    return graph.node("LayerNormalization", x, f"{name}.weight", f"{name}.bias", epsilon=_NORM_EPSILON)
