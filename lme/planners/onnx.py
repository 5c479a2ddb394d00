"""Policy that was trained elsewhere, such as in `lme.gym`, and saved as an ONNX file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError, argument_error, config_key, nearest, require
from lme.inputs.guarded_file import expanded
from lme.inputs.onnx_file import OnnxNetwork
from lme.perception.resampling import nearest_by_sector
from lme.planners.commands import limited
from lme.robots import Robot
from lme.types import Floats, Guidance, LaserScan, Observation, Twist

PARTS = ("scan", "target", "twist", "limits", "action")
FORMS = ("xy", "polar")
Part = NDArray[np.float32]
_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}
_NUMBERS = re.compile(r"tensor\((u?int\d+|float\d*|double)\)")


@dataclass(slots=True)
class OnnxScanConfig:
    """Scan: ranges, from right to left."""

    beams: int | None
    clip: float | None
    scaled: list[float] | None

    def __post_init__(self) -> None:
        if self.beams is not None:
            require("beams", self.beams, at_least=1)
        if self.clip is not None:
            require("clip", self.clip, above=0.0)
        _check_pair("scaled", self.scaled)


@dataclass(slots=True)
class OnnxTargetConfig:
    """Target, or the guide's subgoal."""

    form: str
    reach: float | None

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise argument_error(f"form is {self.form!r}: must be one of {', '.join(FORMS)}")
        if self.reach is not None:
            require("reach", self.reach, above=0.0)


@dataclass(slots=True)
class OnnxTwistConfig:
    """Current velocity."""

    v: float | None
    omega: float | None

    def __post_init__(self) -> None:
        for key in ("v", "omega"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)


@dataclass(slots=True)
class OnnxActionConfig:
    """Meaning of the two outputs."""

    v: list[float] | None
    omega: list[float] | None
    clip: bool

    def __post_init__(self) -> None:
        for key in ("v", "omega"):
            _check_pair(key, getattr(self, key))


@dataclass(slots=True)
class OnnxConfig:
    """File, the parts of the observation that its network takes, and their scaling.

    inputs: parts in the order in which a network with one input takes them. A network with several inputs takes them
    by name.
    """

    path: str | None
    inputs: list[str]
    scan: OnnxScanConfig
    target: OnnxTargetConfig
    twist: OnnxTwistConfig
    action: OnnxActionConfig

    def __post_init__(self) -> None:
        for part in self.inputs:
            if part not in PARTS:
                hint = nearest(str(part), PARTS)
                raise argument_error(f"inputs has {part!r}: {hint}each must be one of {', '.join(PARTS)}")
        if not self.inputs or len(set(self.inputs)) < len(self.inputs):
            raise argument_error(f"inputs is {list(self.inputs)}: must name at least one part, each once")


def _check_pair(key: str, given: list[float] | None) -> None:
    """Raise InputError unless the value is a pair, the two ends of a range, or None."""
    if given is not None and (len(given) != 2 or given[0] == given[1]):
        raise argument_error(
            f"{key} is {list(given)}: must be two different numbers, such as [-1, 1], or null"
        )


class OnnxPolicy:
    """Follows the policy in an ONNX file (docs/howto/environments.md).

    The policy maps the parts of the observation that the config names to two numbers, for v and ω. Its target is the
    guide's subgoal. The command is limited to what the robot can reach in a period.
    """

    Config = OnnxConfig

    def __init__(self, config: OnnxConfig, robot: Robot) -> None:
        if config.path is None:
            raise argument_error(
                "path is null: must be the path of an .onnx file (docs/howto/environments.md)"
            )
        self._config, self._robot = config, robot
        self._features = OnnxFeatures(config, robot)
        self._network = Network(expanded(config.path), self._features.sizes)
        self._last: Floats = np.zeros(2)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last outputs; `rng` is not used."""
        self._last = np.zeros(2)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period. Raises InputError for outputs that are not finite."""
        answer = self._network.answer(self._features.of(observation, guidance.subgoal, self._last))
        if not np.isfinite(answer).all():
            raise argument_error(
                f"path is {self._config.path}: the network answers {answer.tolist()}; must be finite numbers"
            )
        self._last = np.clip(answer, -1.0, 1.0) if self._config.action.clip else answer
        action, limits, (v, omega) = self._config.action, observation.limits, self._last.tolist()
        v = _between(v, action.v or [-limits.v_max, limits.v_max])
        omega = _between(omega, action.omega or [-limits.omega_max, limits.omega_max])
        return limited(v, omega, observation, self._robot.dt)


def _between(output: float, ends: list[float]) -> float:
    """Map an output to the range in which −1 and 1 are the ends; for symmetric ends, their product with it."""
    middle, half = (ends[0] + ends[1]) / 2.0, (ends[1] - ends[0]) / 2.0
    return middle + output * half


class OnnxFeatures:
    """Parts of the observation that `inputs` names, as float32 vectors.

    The arithmetic is that of `lme.gym`, in float32 and in the same order, so that an environment's observation and
    this one are equal to the last bit. Raises InputError for more `planner.scan.beams` than the lidar has.
    """

    def __init__(self, config: OnnxConfig, robot: Robot) -> None:
        have, wanted = robot.lidar.num_beams, config.scan.beams
        if wanted is not None and wanted > have:
            raise argument_error(f"scan.beams is {wanted}: must be at most the lidar's {have}")
        self._config, self._beams = config, have if wanted is None else wanted
        self._have = have
        known = {"scan": self._beams, "target": 2, "twist": 2, "limits": 4, "action": 2}
        self.sizes = {part: known[part] for part in config.inputs}

    def of(self, observation: Observation, subgoal: Floats, action: Floats) -> dict[str, Part]:
        """Return the parts at one step. subgoal: (2,) in the robot frame [m]; action: the last outputs (2,)."""
        config = self._config
        units = np.array([config.twist.v or 1.0, config.twist.omega or 1.0], dtype=np.float32)
        twist: Part = np.array(observation.twist, dtype=np.float32) / units
        made: dict[str, Part] = {
            "scan": self._scan(observation.scan),
            "target": target_part(subgoal, config.target),
            "twist": twist,
            "limits": np.array(observation.limits.bounds, dtype=np.float32),
            "action": action.astype(np.float32),
        }
        return {part: made[part] for part in self.sizes}

    def _scan(self, scan: LaserScan) -> Part:
        if len(scan.ranges) == 0:  # nothing is in sight
            scan = scan._replace(ranges=np.full(self._have, np.inf, dtype=np.float32))
        if len(scan.ranges) != self._have:
            raise InputError(
                f"the scan has {len(scan.ranges)} beams, but robot.lidar.num_beams is {self._have}: must be equal"
            )
        return scan_part(scan, self._beams, self._config.scan)


def scan_part(scan: LaserScan, beams: int, config: OnnxScanConfig) -> Part:
    """Ranges from right to left: (beams,). A beam without a return has range_max."""
    ranges = np.where(np.isnan(scan.ranges), np.float32(np.inf), scan.ranges)
    if scan.angle_increment < 0.0:
        ranges = ranges[::-1]
    nearest = nearest_by_sector(np.minimum(ranges, np.float32(scan.range_max)), beams)
    clip = scan.range_max if config.clip is None else config.clip
    cut: Part = np.minimum(nearest, clip)
    if config.scaled is None:
        return cut
    low, high = config.scaled
    return cut / clip * (high - low) + low


def target_part(subgoal: Floats, config: OnnxTargetConfig) -> Part:
    """Target (2,): x and y, or distance and bearing. With `reach`, in shares of it, the bearing in shares of π."""
    target: Part = subgoal.astype(np.float32)
    away = np.hypot(target[:1], target[1:])
    if config.form == "polar":
        bearing = np.arctan2(target[1:], target[:1])
        if config.reach is None:
            return np.concatenate([away, bearing])
        return np.concatenate([np.minimum(away / config.reach, 1.0), bearing / math.pi]).astype(np.float32)
    return target if config.reach is None else (target / np.maximum(config.reach, away)).astype(np.float32)


class Network:
    """Policy in an ONNX file.

    path: of the file. sizes: of the parts that `inputs` names, in order. A network with one input takes them
    joined, one with several takes each by its name. Raises InputError as `OnnxNetwork` does, and if inputs or outputs
    do not match.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int]) -> None:
        self._path, self._network = path, OnnxNetwork(path, config_key(f"path is {path}"))
        self._inputs = self._network.inputs
        self._joined = len(self._inputs) == 1
        self._check_inputs(sizes)
        self._check_output()
        self.answer({part: np.zeros(size, dtype=np.float32) for part, size in sizes.items()})

    def answer(self, parts: Mapping[str, Part]) -> Floats:
        """Return the first two outputs (2,) for the parts of one observation."""
        joined = np.concatenate(list(parts.values())) if self._joined else None
        given = {}
        for each in self._inputs:
            values = parts[each.name] if joined is None else joined
            given[each.name] = values.astype(_TYPES[each.type]).reshape((1,) * (len(each.shape) - 1) + (-1,))
        outputs = self._network.run(given)
        answer = np.asarray(outputs[0], dtype=np.float64).ravel()
        if answer.shape != (2,):
            shape = np.shape(outputs[0])
            raise argument_error(
                f"path is {self._path}: its first output has the shape {shape}; must be two numbers, "
                "for v and omega"
            )
        return answer

    def _check_output(self) -> None:
        outputs = self._network.outputs
        kind = outputs[0].type if outputs else "nothing"
        if not _NUMBERS.fullmatch(kind):
            raise argument_error(
                f"path is {self._path}: its first output is {kind}; must be two numbers, for v and omega"
            )

    def _check_inputs(self, sizes: Mapping[str, int]) -> None:
        if not self._inputs:
            raise argument_error(f"path is {self._path}: has no inputs; must take {', '.join(sizes)}")
        for each in self._inputs:
            if each.type not in _TYPES:
                raise argument_error(
                    f"path is {self._path}: its input {each.name} is a {each.type}; "
                    f"must be one of {', '.join(_TYPES)}"
                )
            if not self._joined and each.name not in sizes:
                names = ", ".join(each.name for each in self._inputs)
                raise argument_error(
                    f"inputs is {list(sizes)}: must name all inputs of {self._path}, which are {names}; "
                    "a recurrent network, which takes its own state, cannot be used"
                )
            size = sum(sizes.values()) if self._joined else sizes[each.name]
            # All axes but the last must be 1 or free.
            if not each.shape or any(isinstance(axis, int) and axis != 1 for axis in each.shape[:-1]):
                raise argument_error(
                    f"path is {self._path}: its input {each.name} has the shape {each.shape}; must be "
                    f"[1, {size}]: export it for a batch of 1, or with a free batch axis"
                )
            # The last axis must have the size of the parts, or be free.
            takes = each.shape[-1]
            if isinstance(takes, int) and takes != size:
                parts = sizes if self._joined else {each.name: size}
                makes = " + ".join(f"{part} {count}" for part, count in parts.items())
                raise argument_error(
                    f"path is {self._path}: its input {each.name} takes {takes} numbers, but inputs "
                    f"and scan make {size} ({makes}): must be equal"
                )
