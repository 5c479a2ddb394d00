"""The Local-Minimum Escaper: one subgoal per step from local observations alone (paper Algorithm 1)."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from lme.errors import InputError, require
from lme.kernels.fan import fan_blocked
from lme.kernels.sectors import cluster
from lme.policy import criteria as paper
from lme.policy.candidates import CandidateConfig, sample
from lme.policy.criteria import ORIGIN, Criterion, View
from lme.policy.maintenance import Choice, History, choose, update_position
from lme.policy.score import CRITERIA, Parameters, score
from lme.policy.surmount import RULES, find_blockage
from lme.policy.weights import read_parameters
from lme.robots import Robot
from lme.sensing.scan_points import is_full_circle, obstacle_points
from lme.types import Floats, Ints, Observation, Twist

PAPER_CRITERIA: Mapping[str, Criterion] = {name: getattr(paper, name) for name in CRITERIA}


@dataclass(slots=True)
class EscaperConfig:
    """What the paper leaves open, and the length of the history."""

    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    blocking: str = "corridor"  # which sector blocks; see `lme.policy.surmount.find_blockage`
    history_length: int = 8  # k, paper §III.C(6)
    history_min_distance: float = 1.0  # [r] history points nearer than this many r do not count

    def __post_init__(self) -> None:
        if self.blocking not in RULES:
            raise InputError(f"guide.blocking is {self.blocking!r}: must be one of {', '.join(RULES)}")
        require("guide.history_length", self.history_length, at_least=1)
        require("guide.history_min_distance", self.history_min_distance, at_least=0.0)


class Decision(NamedTuple):
    """One step of Algorithm 1.

    subgoal: (2,) in the robot frame [m]. blocked: no candidate is reachable, the best of them stands.
    """

    subgoal: Floats
    choice: Choice
    blocked: bool


class Explanation(NamedTuple):
    """Everything behind one decision; N candidates, C criteria, M scan points, K sectors.

    candidates: (N, 2). features: (C, N), rows named by `names`. scores: (N,). new: index of the best.
    old, old_features, old_score: the old subgoal where it lies now (2,), its (C,) features and its score;
    None at the first step. view: what the criteria saw. sectors: (K, 2) first and last scan point of each;
    closed: one ring all round. E1, E2, A, B are in `view.blockage`. parameters: weights in the order of `names`.
    """

    decision: Decision
    names: tuple[str, ...]
    candidates: Floats
    features: Floats
    scores: Floats
    new: int
    old: Floats | None
    old_features: Floats | None
    old_score: float | None
    view: View
    sectors: Ints
    closed: bool
    parameters: Parameters


class _Step(NamedTuple):
    """The pool is the candidates followed, from index `old` on, by the old subgoal where there is one."""

    decision: Decision
    view: View
    pool: Floats
    features: Floats
    scores: Floats
    new: int
    old: int | None


class LocalMinimumEscaper:
    """Subgoal generation and maintenance; the local planner is somebody else's."""

    def __init__(
        self,
        robot: Robot,
        parameters: Mapping[str, float],
        config: EscaperConfig | None = None,
        criteria: Mapping[str, Criterion] = PAPER_CRITERIA,
    ) -> None:
        """parameters: a weight for each criterion by name, and d1 [m], d2. criteria: c_o among them."""
        self._robot = robot
        self._config = config or EscaperConfig()
        self._names = tuple(criteria)
        self._criteria = tuple(criteria.values())
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
        """With the parameters of a weight file. Raises InputError where it is missing or not right."""
        return cls(robot, read_parameters(Path(path), tuple(criteria)), config, criteria)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode; candidates are drawn from `rng`."""
        self._rng = rng
        self._history = History(
            self._config.history_length, self._config.history_min_distance * self._robot.r
        )
        self._subgoal: Floats | None = None
        self._twist: Twist | None = None

    def decide(self, observation: Observation) -> Decision:
        """Advance one control period and return the subgoal."""
        return self._step(observation).decision

    def explain(self, observation: Observation) -> Explanation:
        """What `decide` would do with this observation now, and all that leads to it. Changes nothing."""
        before = self._rng, self._history, self._subgoal, self._twist
        self._rng, self._history = copy.deepcopy(before[:2])
        try:
            step = self._step(observation)
        finally:
            self._rng, self._history, self._subgoal, self._twist = before
        has_old = step.old is not None
        sectors, closed = cluster(step.view.points, 2.0 * step.view.radius, is_full_circle(observation.scan))
        return Explanation(
            decision=step.decision,
            names=self._names,
            candidates=step.pool[: step.old],
            features=step.features[:, : step.old],
            scores=step.scores[: step.old],
            new=step.new,
            old=step.pool[-1] if has_old else None,
            old_features=step.features[:, -1] if has_old else None,
            old_score=float(step.scores[-1]) if has_old else None,
            view=step.view,
            sectors=sectors,
            closed=closed,
            parameters=self._parameters,
        )

    def _step(self, observation: Observation) -> _Step:
        """Algorithm 1: generate, score, keep or switch."""
        self._advance(observation.twist)
        view = self._look(observation)
        pool = self._generate(observation, view)
        old = None if self._subgoal is None else len(pool)
        if self._subgoal is not None:
            pool = np.concatenate((pool, self._subgoal[None]))
        features = np.empty((len(self._criteria), len(pool)))
        for row, criterion in zip(features, self._criteria, strict=True):
            row[:] = criterion(pool, view)
        scores = score(features, self._parameters.weights)
        new = int(np.argmax(scores[:old]))
        choice = self._choose(scores, new)
        if choice is not Choice.KEPT:
            self._subgoal = pool[new]
        assert self._subgoal is not None
        blocked = not features[self._reachable, :old].any()
        return _Step(Decision(self._subgoal.copy(), choice, blocked), view, pool, features, scores, new, old)

    def _advance(self, twist: Twist) -> None:
        """Carry history and old subgoal from the last robot frame into the present one."""
        if self._twist is not None:
            self._history.step(self._twist, twist, self._robot.dt)
        if self._twist is not None and self._subgoal is not None:
            self._subgoal = update_position(self._subgoal[None], self._twist, twist, self._robot.dt)[0]
        self._twist = twist

    def _look(self, observation: Observation) -> View:
        scan = observation.scan
        points = obstacle_points(scan, self._robot.lidar.mount)
        radius, target = self._robot.r, observation.target
        full_circle = is_full_circle(scan)
        blockage = find_blockage(points, target, radius, full_circle, self._config.blocking)
        return View(points, target, radius, self._history.points(), blockage)

    def _generate(self, observation: Observation, view: View) -> Floats:
        """Random candidates in the field of view, and the target itself where it is in view and free.

        Ranges and bearings are about the base, as the paper has them, and so is the field of view: a lidar
        mounted off the base sees all but a strip as wide as the mount's offset. Candidates about the lidar
        would crowd ahead of the base, and a robot that wants to stay would creep.
        """
        config, scan = self._config.candidates, observation.scan
        reach = min(config.max_range, scan.range_max)
        span = scan.angle_increment * (len(scan.ranges) - (not is_full_circle(scan)))  # negative if clockwise
        bearing_min, fov = scan.angle_min + self._robot.lidar.yaw + min(span, 0.0), abs(span)
        candidates = sample(self._rng, config, reach, bearing_min, fov)
        target = view.target
        if not config.target or not _in_view(target, reach, bearing_min, fov):
            return candidates
        if fan_blocked(ORIGIN, target[None], view.points, view.radius)[0]:
            return candidates
        return np.concatenate((candidates, target[None]))

    def _choose(self, scores: Floats, new: int) -> Choice:
        if self._subgoal is None:
            return Choice.FIRST
        distance = math.hypot(self._subgoal[0], self._subgoal[1])
        return choose(distance, scores[-1], scores[new], self._parameters.d1, self._parameters.d2)


def _in_view(point: Floats, reach: float, bearing_min: float, fov: float) -> bool:
    """Whether a point lies in the sector [bearing_min, bearing_min + fov], up to `reach`."""
    off_centre = math.remainder(math.atan2(point[1], point[0]) - bearing_min - fov / 2, 2 * math.pi)
    return math.hypot(point[0], point[1]) <= reach and abs(off_centre) <= fov / 2
