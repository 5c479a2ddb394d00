"""The paper's policy as a guide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError, argument_error
from lme.guides.lme.criteria import Criterion
from lme.guides.lme.escaper import PAPER_CRITERIA, EscaperConfig, LocalMinimumEscaper
from lme.guides.lme.explanation import Explanation
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters
from lme.inputs.user_code import import_module
from lme.robots import Robot
from lme.types import Guidance, Observation


@dataclass(slots=True)
class LmeConfig(EscaperConfig):
    """An escaper's settings, its parameters by name, and further criteria as {name: dotted path}.

    weight_set: its own. parameters: {}: those of the weight set.
    """

    weight_set: str
    parameters: dict[str, float]
    criteria: dict[str, str]


class Lme:
    """Local-Minimum Escaper (paper §III)."""

    Config = LmeConfig

    def __init__(self, config: LmeConfig, robot: Robot) -> None:
        parameters = config.parameters or learned_parameters(PUBLISHED, config.weight_set)
        criteria = {**PAPER_CRITERIA, **_load(config.criteria)}
        self.escaper = LocalMinimumEscaper(robot, parameters, config, criteria)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self.escaper.reset(rng)

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal of Algorithm 1."""
        decision = self.escaper.decide(observation)
        return Guidance(decision.subgoal, None, decision.choice.switched, decision.blocked)

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return self.escaper.explanation()


def _load(paths: Mapping[str, str]) -> dict[str, Criterion]:
    """Import criteria by dotted path."""
    loaded = {}
    for name, path in paths.items():
        module, _, attribute = path.rpartition(".")
        try:
            loaded[name] = getattr(import_module(module), attribute)
        except (InputError, AttributeError, ValueError) as error:
            raise argument_error(
                f"criteria.{name} is {path!r}: must be the dotted path of a function ({error})"
            ) from error
    return loaded
