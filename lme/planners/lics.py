"""LiCS-KI: an imitation-learned transformer along a global path, which won the BARN Challenge of 2024.

The network reads a sweep as 36 tokens of 20 beams, and the direction of the goal as two tokens of one number. Names
and shapes of its weights are those of the authors' `state_dict`: three layers of an encoder, in which the tokens of the
sweep attend to each other, three of a decoder, in which those of the goal attend to them, and a head over both.
"""

from __future__ import annotations

import math
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError, require
from lme.inputs.guarded_file import check_regular
from lme.inputs.onnx_file import Arrays, Shape, Signature, SignedNetwork
from lme.inputs.onnx_graph import OnnxGraph, check_finite
from lme.inputs.resources import resource_dir
from lme.planners.commands import limited
from lme.planners.drl_vo.importing import DAMAGE, TorchFile
from lme.robots import Robot
from lme.types import Floats, Guidance, LaserScan, Observation, Twist

SHIPPED = "lics_ki.onnx"  # in conf/network/
BEAMS, PATCHES, GOAL = 720, 36, 2
WIDTH, HEADS, HIDDEN, LAYERS = 32, 4, 256, 3
ENCODER, DECODER = ("encoder.layers", "self_attn"), ("decoder.layers", "encoder_attn")
FRONT = slice(253, 467)  # beams within 40° of straight ahead, as the authors choose them
_BEARINGS = np.radians(np.linspace(-135.0, 135.0, BEAMS))
_AT_ROBOT = 0.05  # [m] a path that begins nearer than this begins at the robot
_NORM_EPSILON = 1e-5  # PyTorch's default of a layer norm


@dataclass(slots=True)
class LicsConfig:
    """Weights of the network, its observation, and the velocities for its output; the authors' names."""

    weights: str | None
    los: float
    laser_clip: float
    threshold_dist: float
    max_v: float
    min_v: float
    max_w: float

    def __post_init__(self) -> None:
        for key in ("los", "laser_clip", "threshold_dist", "max_v", "max_w"):
            require(key, getattr(self, key), above=0.0)
        require("min_v", self.min_v, at_most=0.0)


class Lics:
    """LiCS (Damanik et al. 2025, RA-L, arXiv 2406.14947), as it won the BARN Challenge of 2024.

    Network, observation and action are those of the authors' entry, LiCS-KI: a sweep of 720 beams and the direction of
    a point on the global path give a velocity, which falls with the least range within 40° of straight ahead. While
    the guide finds no path, the direction stays the same in the robot frame. The entry has no recovery, and no
    notion of arrival. The command is limited to what the robot can reach in a period.
    """

    Config = LicsConfig

    def __init__(self, config: LicsConfig, robot: Robot) -> None:
        path = Path(config.weights) if config.weights else resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(path, SIGNATURE)
        self._config = config
        self._robot = robot

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the direction."""
        self._direction: Floats = np.zeros(2)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config = self._config
        ranges = sweep(observation.scan, self._robot.lidar.yaw, config.laser_clip)
        if not guidance.blocked:
            path = guidance.path if guidance.path is not None else guidance.subgoal[None]
            self._direction = direction_along(path, config.los)
        (velocity,) = self._network.answer(ranges, self._direction)
        v, omega = velocity.tolist()
        v *= config.max_v * min(float(ranges[FRONT].min()) / config.threshold_dist, 1.0)
        v, omega = min(max(v, config.min_v), config.max_v), omega * config.max_w
        omega = min(max(omega, -config.max_w), config.max_w)
        return limited(v, omega, observation, self._robot.dt)


def sweep(scan: LaserScan, mount_yaw: float, clip: float) -> NDArray[np.float32]:
    """Range of the nearest beam in each of the 720 directions, from the right to the left: (720,) [m].

    mount_yaw: of the lidar in the base frame [rad]. A beam without a return, a direction without a beam, and a range
    above `clip` give `clip`.
    """
    ranges = np.full(BEAMS, clip, np.float32)
    if len(scan.ranges) == 0 or scan.angle_increment == 0.0:
        return ranges
    step, first = scan.angle_increment, scan.angle_min + mount_yaw
    turned = (_BEARINGS - first) * math.copysign(1.0, step)  # from the first beam on
    beams = np.rint((turned + abs(step) / 2.0) % math.tau / abs(step) - 0.5).astype(np.int64)
    seen = beams < len(scan.ranges)
    found = scan.ranges[np.where(seen, beams, 0)]
    with np.errstate(invalid="ignore"):
        seen &= (found >= scan.range_min) & (found < scan.range_max)
    ranges[seen] = np.minimum(found[seen], np.float32(clip))
    return ranges


def direction_along(path: Floats, los: float) -> Floats:
    """Unit vector (2,) to the first point of a path (K, 2) [m] that is farther than `los` [m] from its start.

    The start is the robot if the path begins there. Without such a point the last one is used; (0, 0) if the path
    ends where it begins. The authors smooth the path first; ours is made of straight pieces and does not need it.
    """
    begin = path[0] if math.hypot(*path[0]) > _AT_ROBOT else np.zeros(2)
    away = path - begin
    far = np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) > los)
    towards = away[far[0] if len(far) else -1]
    length = math.hypot(*towards)
    return towards / length if length > 0.0 else np.zeros(2)


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


def import_state(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return the arrays of `SHAPES` in a `state_dict` that PyTorch saved, such as `transformer_99.pth`.

    Nothing in the file is executed, and PyTorch is not needed. The zip's own checksums are verified. Raises
    InputError, naming file and array.
    """
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive:
            saved = TorchFile(archive)
            found = {name: tensor.shape for name, tensor in saved.tensors.items()}
            # Compare all shapes before any array is read.
            for name, shape in SHAPES.items():
                if found.get(name) != shape:
                    raise InputError(
                        f"{path}: {name} is {found.get(name, 'missing')}: must be float32 {shape}"
                    )
            weights = {name: saved.read(name) for name in SHAPES}
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DAMAGE as error:
        raise InputError(f"{path}: is not {SIGNATURE.what} that PyTorch saved ({error})") from None
    check_finite(weights, str(path))
    return weights
