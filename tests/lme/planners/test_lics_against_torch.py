"""Our transformer answers as PyTorch's, with the authors' weights and with random ones."""

import math

import numpy as np
import pytest

from lme.guides.lme.weight_files import find_network
from lme.inputs.onnx_graph import read_weights
from lme.planners.lics import SIGNATURE, write_weights
from tests.networks import random_lics, signed
from tests.tolerances import FLOAT32_LAYER

torch = pytest.importorskip("torch", reason="PyTorch is not installed")
functional = torch.nn.functional


def published(weights, ranges, direction):
    """The output (2,) of the authors' model for a sweep (720,) and a direction (2,); weights: arrays by name."""
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


@pytest.mark.parametrize("name", ["the authors'", "random"])
def test_the_network_answers_as_in_torch(tmp_path, name):
    weights = read_weights(find_network("lics_ki"), SIGNATURE.what) if name != "random" else random_lics()
    network, rng = signed(SIGNATURE, tmp_path / "w.onnx", write_weights, weights), np.random.default_rng(0)
    answers = []
    for _ in range(20):
        ranges = np.minimum(rng.uniform(0.0, 8.0, 720), 5.0).astype(np.float32)
        bearing = rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(bearing), np.sin(bearing)])
        answers.append(network.answer(ranges, direction)[0])
        assert answers[-1] == pytest.approx(published(weights, ranges, direction), abs=FLOAT32_LAYER)
    assert np.ptp(answers, axis=0).min() > 100 * FLOAT32_LAYER  # the inputs matter
