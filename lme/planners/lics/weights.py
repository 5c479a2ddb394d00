"""Layers of the LiCS network, and its weights in a file: an .npz with the arrays of `SHAPES`, float32.

The network reads a sweep as 36 tokens of 20 beams, and the direction of the goal as two tokens of one number. Names
and shapes are those of the authors' `state_dict`: three layers of an encoder, in which the tokens of the sweep attend
to each other, three of a decoder, in which those of the goal attend to them, and a head over both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.inputs.array_file import read_arrays

WHAT = "a LiCS network"
BEAMS, PATCHES, GOAL = 720, 36, 2
WIDTH, HEADS, HIDDEN, LAYERS = 32, 4, 256, 3
ENCODER, DECODER = ("encoder.layers", "self_attn"), ("decoder.layers", "encoder_attn")


def _shapes() -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {
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


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the arrays of `SHAPES` from a file that `array_file.write_arrays` made.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is created before its shape is known to be right.
    """
    return read_arrays(path, SHAPES, WHAT)
