"""The Local-Minimum Escaper: one subgoal per step from local observations alone (paper Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from lme.errors import InputError, require
from lme.geometry.fan import fan_blocked
from lme.guides.lme import criteria as paper
from lme.guides.lme.candidates import CandidateConfig, sample
from lme.guides.lme.criteria import ORIGIN, SURMOUNT, Criterion, View
from lme.guides.lme.explanation import Decision, Explanation, Step, explain
from lme.guides.lme.maintenance import Choice, History, carried, choose
from lme.guides.lme.score import CRITERIA, Parameters, rank, read_parameters
from lme.guides.lme.surmount import RULES, find_blockage
from lme.inputs.returned import checked_values
from lme.perception.dead_reckoning import DeadReckoning
from lme.perception.scan_points import is_full_circle, obstacle_points
from lme.robots import Robot
from lme.types import Floats, Observation

PAPER_CRITERIA: Mapping[str, Criterion] = {name: getattr(paper, name) for name in CRITERIA}


@dataclass(slots=True)
class EscaperConfig:
    """Settings that the paper leaves open, and the length of the history."""

    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    blocking: str = "corridor"  # rule for the blocking sector; see `lme.guides.lme.surmount.find_blockage`
    surmount: str = (
        "every"  # which candidates have a surmount feature; see `lme.guides.lme.criteria.SURMOUNT`
    )
    history_length: int = 8  # k, paper §III.C(6)
    history_min_distance: float = 1.0  # [r] nearer history points are ignored

    def __post_init__(self) -> None:
        if self.blocking not in RULES:
            raise InputError(f"guide.blocking is {self.blocking!r}: must be one of {', '.join(RULES)}")
        if self.surmount not in SURMOUNT:
            raise InputError(f"guide.surmount is {self.surmount!r}: must be one of {', '.join(SURMOUNT)}")
        require("guide.history_length", self.history_length, at_least=1)
        require("guide.history_min_distance", self.history_min_distance, at_least=0.0)


class LocalMinimumEscaper:
    """Generator of subgoals, which also maintains the current one. A local planner must drive to them."""

    def __init__(
        self,
        robot: Robot,
        parameters: Mapping[str, float],
        config: EscaperConfig | None = None,
        criteria: Mapping[str, Criterion] = PAPER_CRITERIA,
    ) -> None:
        """parameters: a weight for each criterion by name, and d1 [m], d2. criteria: must include c_o."""
        self._mount, self._radius, self._dt = robot.lidar.mount, robot.r, robot.dt
        self._config = config or EscaperConfig()
        self._names = tuple(criteria)
        self._criteria = tuple(
            criterion if criterion is PAPER_CRITERIA.get(name) else _checked(criterion)
            for name, criterion in criteria.items()
        )
        self._reachable = self._names.index("c_o")
        self._parameters = Parameters.from_mapping(parameters, self._names)
        self.reset(np.random.default_rng(0))

    @classmethod
    def from_file(
        cls,
        path: Path | str,
        robot: Robot,
        config: EscaperConfig | None = None,
        criteria: Mapping[str, Criterion] = PAPER_CRITERIA,
    ) -> Self:
        """Create an escaper with the parameters of a weight file. Raises InputError if it is missing or invalid."""
        return cls(robot, read_parameters(Path(path), tuple(criteria)), config, criteria)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self._rng = rng
        self._history = History(self._config.history_length, self._config.history_min_distance * self._radius)
        self._subgoal: Floats | None = None
        self._reckoning = DeadReckoning(self._dt)
        self._last_step: Step | None = None

    def decide(self, observation: Observation) -> Decision:
        """Advance one control period and return the subgoal."""
        self._last_step = self._step(observation)
        return self._last_step.decision

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return None if self._last_step is None else explain(self._last_step)

    def _step(self, observation: Observation) -> Step:
        """Run one step of Algorithm 1: generate, score, keep or switch."""
        self._advance(observation)
        view = self._look(observation)
        parts = self._generate(observation, view)
        candidates = sum(map(len, parts))
        old = None if self._subgoal is None else candidates
        if self._subgoal is not None:
            parts.append(self._subgoal[None])
        # Score the candidates and, in the last column, the old subgoal.
        pool = np.concatenate(parts)
        features = np.empty((len(self._criteria), len(pool)))
        for row, criterion in enumerate(self._criteria):
            features[row] = criterion(pool, view)
        scores, new, blocked = rank(features, self._parameters.weights, candidates, self._reachable)
        choice = self._choose(scores, new)
        if choice is not Choice.KEPT:
            self._subgoal = pool[new].copy()  # callers may write to the pool
        assert self._subgoal is not None
        decision = Decision(self._subgoal.copy(), choice, blocked)
        names, parameters = self._names, self._parameters
        return Step(decision, names, parameters, observation.scan, view, pool, features, scores, new, old)

    def _advance(self, observation: Observation) -> None:
        """Transform the history and the old subgoal from the last robot frame to the current one."""
        move = self._reckoning.move(observation)
        if move is None:
            return
        self._history.step(move, self._dt)
        if self._subgoal is not None:
            self._subgoal = carried(self._subgoal[None], move, self._dt)[0]

    def _look(self, observation: Observation) -> View:
        scan = observation.scan
        points = obstacle_points(scan, self._mount)
        radius, target = self._radius, observation.target
        full_circle = is_full_circle(scan)
        blockage = find_blockage(points, target, radius, full_circle, self._config.blocking)
        return View(points, target, radius, self._history.points(), blockage, self._config.surmount)

    def _generate(self, observation: Observation, view: View) -> list[Floats]:
        """Random candidates in the field of view, and the target itself if it is in view and free: (N, 2) each.

        Ranges, bearings and the field of view are about the base, as in the paper: a lidar mounted off the base
        misses only a strip as wide as the mount's offset. Candidates drawn about the lidar would be denser ahead
        of the base, so a robot that should stay in place would creep forward.
        """
        config, scan = self._config.candidates, observation.scan
        reach = min(config.max_range, scan.range_max)
        span = scan.angle_increment * (len(scan.ranges) - (not is_full_circle(scan)))  # negative if clockwise
        bearing_min, fov = scan.angle_min + self._mount.yaw + min(span, 0.0), abs(span)
        candidates = sample(self._rng, config, reach, bearing_min, fov)
        target = view.target
        if not config.target or not _in_view(target, reach, bearing_min, fov):
            return [candidates]
        if fan_blocked(ORIGIN, target[None], view.points, view.radius)[0]:
            return [candidates]
        return [candidates, target[None]]

    def _choose(self, scores: Floats, new: int) -> Choice:
        if self._subgoal is None:
            return Choice.FIRST
        distance = math.hypot(*self._subgoal.tolist())
        return choose(distance, scores[-1], scores[new], self._parameters.d1, self._parameters.d2)


def _checked(criterion: Criterion) -> Criterion:
    """Wrap a user's criterion so that it raises ReturnedError unless it gives each candidate a finite number."""
    return lambda candidates, view: checked_values(criterion(candidates, view), len(candidates), criterion)


def _in_view(point: Floats, reach: float, bearing_min: float, fov: float) -> bool:
    """Return whether a point lies in the sector [bearing_min, bearing_min + fov], within `reach` [m]."""
    x, y = point.tolist()
    off_centre = math.remainder(math.atan2(y, x) - bearing_min - fov / 2, 2 * math.pi)
    return math.hypot(x, y) <= reach and abs(off_centre) <= fov / 2
