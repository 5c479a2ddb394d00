"""Config of a policy in an ONNX file: its observation, and the meaning of its outputs."""

from __future__ import annotations

from dataclasses import dataclass

from lme.errors import argument_error, nearest, require

PARTS = ("scan", "target", "twist", "limits", "action")
FORMS = ("xy", "polar")


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
