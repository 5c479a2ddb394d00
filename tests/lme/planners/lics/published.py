"""The LiCS network in PyTorch, after the authors' model: what our compiled one must answer."""

import math

import torch
from torch.nn import functional


def answer(weights, ranges, direction):
    """The output (2,) for a sweep (720,) and a direction (2,); weights: arrays by the authors' names."""
    tensors = {name: torch.tensor(array) for name, array in weights.items()}

    def linear(name, inputs):
        return functional.linear(inputs, tensors[f"{name}.weight"], tensors.get(f"{name}.bias"))

    def norm(name, inputs):
        return functional.layer_norm(inputs, (32,), tensors[f"{name}.weight"], tensors[f"{name}.bias"])

    def heads(tokens):
        return tokens.view(1, -1, 4, 8).transpose(1, 2)

    def attend(name, tokens, attended):
        q = heads(linear(f"{name}.q_proj", tokens))
        k, v = (heads(linear(f"{name}.{part}_proj", attended)) for part in ("k", "v"))
        weighted = (q @ (k / math.sqrt(32)).transpose(-1, -2)).softmax(-1) @ v
        return linear(f"{name}.out_proj", weighted.transpose(1, 2).reshape(1, -1, 32))

    def layer(name, attention, tokens, attended):
        mixed = tokens + attend(f"{name}.{attention}", tokens, attended)
        tokens = norm(f"{name}.{attention}_layer_norm", mixed)
        forward = f"{name}.PositionWiseFeedForward"
        return norm(
            f"{name}.final_layer_norm",
            tokens + linear(f"{forward}.w_2", linear(f"{forward}.w_1", tokens).relu()),
        )

    with torch.no_grad():
        patches = torch.tensor(ranges, dtype=torch.float32).view(1, 36, 20)
        seen = linear("encoder.embedding.linear", patches) + tensors["encoder.embedding.pos_embed"]
        for k in range(3):
            seen = layer(f"encoder.layers.{k}", "self_attn", seen, seen)
        wanted = linear("decoder.linear", torch.tensor(direction, dtype=torch.float32).view(1, 2, 1))
        for k in range(3):
            wanted = layer(f"decoder.layers.{k}", "encoder_attn", wanted, seen)
        return linear("prediction_head", wanted.reshape(1, 64)).numpy()[0]
