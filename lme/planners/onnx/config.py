"""Config of a policy in an ONNX file: its observation, and the meaning of its outputs."""

from __future__ import annotations

from dataclasses import dataclass, field

from lme.errors import InputError, nearest, require

PARTS = ("scan", "target", "twist", "limits", "action")
FORMS = ("xy", "polar")


@dataclass(slots=True)
class OnnxScanConfig:
    """Scan: ranges, from right to left."""

    beams: int | None = None  # each the nearest return of a group of neighbours; None: all of the lidar's
    clip: float | None = None  # [m] longer ranges become this one; None: the lidar's range_max
    scaled: list[float] | None = None  # what ranges of 0 and `clip` become, such as [-1, 1]; None: metres

    def __post_init__(self) -> None:
        if self.beams is not None:
            require("planner.scan.beams", self.beams, at_least=1)
        if self.clip is not None:
            require("planner.scan.clip", self.clip, above=0.0)
        _check_pair("planner.scan.scaled", self.scaled)


@dataclass(slots=True)
class OnnxTargetConfig:
    """Target, or the guide's subgoal."""

    form: str = "xy"  # xy: ahead and left | polar: distance and bearing [rad]
    reach: float | None = None  # [m] becomes 1, and farther targets are moved in to it; None: metres

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise InputError(f"planner.target.form is {self.form!r}: must be one of {', '.join(FORMS)}")
        if self.reach is not None:
            require("planner.target.reach", self.reach, above=0.0)


@dataclass(slots=True)
class OnnxTwistConfig:
    """Current velocity."""

    v: float | None = None  # [m/s] that becomes 1; None: m/s
    omega: float | None = None  # [rad/s] that becomes 1; None: rad/s

    def __post_init__(self) -> None:
        for key in ("v", "omega"):
            if getattr(self, key) is not None:
                require(f"planner.twist.{key}", getattr(self, key), above=0.0)


@dataclass(slots=True)
class OnnxActionConfig:
    """Meaning of the two outputs."""

    v: list[float] | None = None  # [m/s] of outputs −1 and 1; None: −v_max and v_max of the robot
    omega: list[float] | None = None  # [rad/s] of outputs −1 and 1; None: −omega_max and omega_max
    clip: bool = True  # outputs beyond ±1 become ±1

    def __post_init__(self) -> None:
        for key in ("v", "omega"):
            _check_pair(f"planner.action.{key}", getattr(self, key))


@dataclass(slots=True)
class OnnxConfig:
    """File, the parts of the observation that its network takes, and their scaling.

    inputs: parts in the order in which a network with one input takes them. A network with several inputs takes them
    by name.
    """

    path: str | None = None  # of the .onnx file
    inputs: list[str] = field(default_factory=lambda: ["scan", "target", "twist", "limits"])
    scan: OnnxScanConfig = field(default_factory=OnnxScanConfig)
    target: OnnxTargetConfig = field(default_factory=OnnxTargetConfig)
    twist: OnnxTwistConfig = field(default_factory=OnnxTwistConfig)
    action: OnnxActionConfig = field(default_factory=OnnxActionConfig)

    def __post_init__(self) -> None:
        for part in self.inputs:
            if part not in PARTS:
                hint = nearest(str(part), PARTS)
                raise InputError(f"planner.inputs has {part!r}: {hint}each must be one of {', '.join(PARTS)}")
        if not self.inputs or len(set(self.inputs)) < len(self.inputs):
            raise InputError(f"planner.inputs is {list(self.inputs)}: must name at least one part, each once")


def _check_pair(key: str, given: list[float] | None) -> None:
    """Raise InputError unless the value is a pair, the two ends of a range, or None."""
    if given is not None and (len(given) != 2 or given[0] == given[1]):
        raise InputError(f"{key} is {list(given)}: must be two different numbers, such as [-1, 1], or null")
