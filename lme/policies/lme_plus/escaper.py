"""LME+: subgoals by expected time, from scans, twist and the target's position alone (docs/lme_plus.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_robot, to_world
from lme.policies.lme.candidates import CandidateConfig, sample
from lme.policies.lme.criteria import View
from lme.policies.lme.explanation import Decision, Explanation, Step, explain
from lme.policies.lme.maintenance import Choice, choose
from lme.policies.lme.score import Parameters, rank
from lme.policies.lme_plus.criteria import CRITERIA, Sight
from lme.policies.lme_plus.memory import Memory, MemoryConfig
from lme.policies.lme_plus.travel import Travel, TravelConfig
from lme.robots import Robot
from lme.types import Floats, Observation

_NONE = np.empty((0, 2))
_REACHABLE = tuple(CRITERIA).index("c_o")


@dataclass(slots=True)
class EscaperPlusConfig:
    """Candidates, memory, expected times, and the distances that ways keep."""

    candidates: CandidateConfig = field(default_factory=lambda: CandidateConfig(number=100))
    structured: bool = True  # places on the fastest way are candidates, too
    memory: MemoryConfig = field(default_factory=MemoryConfig)
    travel: TravelConfig = field(default_factory=TravelConfig)
    margin: float = 0.08  # [m] distance of a straight way's sides and front to obstacle points
    turn_margin: float = 0.08  # [m] distance of the outline in a turn

    def __post_init__(self) -> None:
        require("guide.margin", self.margin, at_least=0.0)
        require("guide.turn_margin", self.turn_margin, at_least=0.0)


class LocalMinimumEscaperPlus:
    """Generates subgoals and maintains the current one, like `lme.policies.lme.escaper.LocalMinimumEscaper`."""

    def __init__(
        self, robot: Robot, parameters: Mapping[str, float], config: EscaperPlusConfig | None = None
    ) -> None:
        """parameters: a weight for each criterion by name, d1 [m], and d2, in the unit of the score."""
        self._robot = robot
        self._config = config or EscaperPlusConfig()
        self._parameters = Parameters.from_mapping(parameters, tuple(CRITERIA))
        self._travel = Travel(self._config.travel, robot, self._config.memory.reach, self._config.margin)
        self.reset(np.random.default_rng(0))

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self._rng = rng
        self._memory = Memory(self._config.memory, self._robot)
        self.sight: Sight | None = None  # of the last decision
        self._subgoal: Floats | None = None  # in the carried frame
        self._last: Step | None = None

    def decide(self, observation: Observation) -> tuple[Decision, Floats]:
        """Advance one control period; the subgoal, and all known obstacle points (M, 2), in the robot frame [m]."""
        self._memory.see(observation)
        self.sight = sight = self._look(observation)
        self._last = step = self._step(observation, sight)
        return step.decision, sight.points

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return None if self._last is None else explain(self._last)

    def _step(self, observation: Observation, sight: Sight) -> Step:
        """Algorithm 1 of the paper, with the criteria of LME+."""
        pool = self._generate(observation, sight)
        candidates = len(pool)
        old = None if self._subgoal is None else candidates
        if self._subgoal is not None:
            pool = np.concatenate((pool, to_robot(self._subgoal, sight.pose)[None]))
        features = np.array([criterion(pool, sight) for criterion in CRITERIA.values()])
        scores, new, blocked = rank(features, self._parameters.weights, candidates, _REACHABLE)
        choice = self._choose(pool, scores, new, old)
        if choice is not Choice.KEPT:
            self._subgoal = to_world(pool[new], sight.pose)
        assert self._subgoal is not None
        decision = Decision(to_robot(self._subgoal, sight.pose), choice, blocked)
        view, names, parameters = self._view(observation, sight), tuple(CRITERIA), self._parameters
        return Step(decision, names, parameters, observation.scan, view, pool, features, scores, new, old)

    def _choose(self, pool: Floats, scores: Floats, new: int, old: int | None) -> Choice:
        if old is None:
            return Choice.FIRST
        distance, parameters = math.hypot(*pool[old]), self._parameters
        return choose(distance, scores[old], scores[new], parameters.d1, parameters.d2)

    def _view(self, observation: Observation, sight: Sight) -> View:
        """What an explanation shows: the points of the scan and the target; LME+ has no history and no blockage."""
        radius = self._robot.footprint.r_min + sight.margin
        return View(self._memory.seen, observation.target, radius, _NONE, None, "every")

    def _look(self, observation: Observation) -> Sight:
        config, robot, pose = self._config, self._robot, self._memory.pose
        target = to_world(observation.target, pose)
        times = self._travel.field(self._memory.points, target, np.array(pose[:2]), self._memory.people)
        return Sight(
            self._memory.known,
            pose,
            times,
            robot.footprint.box,
            config.margin,
            config.turn_margin,
            robot.v_max,
        )

    def _generate(self, observation: Observation, sight: Sight) -> Floats:
        """Random candidates all around, places on the fastest way, and the target if it is in range."""
        config = self._config.candidates
        reach = min(config.max_range, observation.scan.range_max)
        parts = [sample(self._rng, config, reach, -math.pi, 2 * math.pi)]
        if self._config.structured:
            parts.append(to_robot(sight.field.descent(reach), sight.pose))
        if config.target and math.hypot(*observation.target) <= reach:
            parts.append(observation.target[None])
        return np.concatenate(parts)
