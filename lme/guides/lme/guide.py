"""The Local-Minimum Escaper: one subgoal per step from local observations alone (paper Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np

from lme.errors import InputError, argument_error, config_key, require
from lme.geometry.fan import fan_blocked
from lme.guides.lme import criteria as paper
from lme.guides.lme.candidates import CandidateConfig, sample
from lme.guides.lme.criteria import ORIGIN, SURMOUNT, Criterion, View
from lme.guides.lme.explanation import Decision, Explanation, explain
from lme.guides.lme.maintenance import Choice, History, carried, choose
from lme.guides.lme.score import CRITERIA, Parameters, rank, read_parameters
from lme.guides.lme.surmount import RULES, find_blockage
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters
from lme.inputs.returned import checked_values
from lme.inputs.user_code import check_call, import_module
from lme.perception.dead_reckoning import DeadReckoning
from lme.perception.scan_points import is_full_circle, obstacle_points
from lme.robots import Robot
from lme.types import Floats, Guidance, LaserScan, Observation

PAPER_CRITERIA: Mapping[str, Criterion] = {name: getattr(paper, name) for name in CRITERIA}


@dataclass(slots=True)
class EscaperConfig:
    """Settings that the paper leaves open, and the length of the history."""

    candidates: CandidateConfig
    blocking: str
    surmount: str
    history_length: int
    history_min_distance: float

    def __post_init__(self) -> None:
        if self.blocking not in RULES:
            raise argument_error(f"blocking is {self.blocking!r}: must be one of {', '.join(RULES)}")
        if self.surmount not in SURMOUNT:
            raise argument_error(f"surmount is {self.surmount!r}: must be one of {', '.join(SURMOUNT)}")
        require("history_length", self.history_length, at_least=1)
        require("history_min_distance", self.history_min_distance, at_least=0.0)


class LocalMinimumEscaper:
    """Generator of subgoals, which also maintains the current one. A local planner must drive to them."""

    def __init__(
        self,
        robot: Robot,
        parameters: Mapping[str, float],
        config: EscaperConfig,
        criteria: Mapping[str, Criterion] = PAPER_CRITERIA,
    ) -> None:
        """parameters: a weight for each criterion by name, and d1 [m], d2. criteria: must include c_o."""
        self._mount, self._radius, self._dt = robot.lidar.mount, robot.r, robot.dt
        self._config = config
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
        config: EscaperConfig,
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
        self._explain: Callable[[], Explanation] | None = None  # the last decision

    def decide(self, observation: Observation) -> Decision:
        """Advance one control period and return the subgoal: generate, score, keep or switch (Algorithm 1)."""
        # Transform the history and the old subgoal from the last robot frame to the current one.
        move = self._reckoning.move(observation)
        if move is not None:
            self._history.step(move, self._dt)
            if self._subgoal is not None:
                self._subgoal = carried(self._subgoal[None], move, self._dt)[0]
        # Find what blocks the target, and generate candidates.
        scan, target, radius = observation.scan, observation.target, self._radius
        points = obstacle_points(scan, self._mount)
        blockage = find_blockage(points, target, radius, is_full_circle(scan), self._config.blocking)
        view = View(points, target, radius, self._history.points(), blockage, self._config.surmount)
        parts = self._generate(scan, view)
        candidates = sum(map(len, parts))
        # Score the candidates and, in the last column, the old subgoal.
        old = None if self._subgoal is None else candidates
        pool = np.concatenate(parts if self._subgoal is None else [*parts, self._subgoal[None]])
        features = np.empty((len(self._criteria), len(pool)))
        for row, criterion in enumerate(self._criteria):
            features[row] = criterion(pool, view)
        parameters = self._parameters
        scores, new, blocked = rank(features, parameters.weights, candidates, self._reachable)
        # Keep the old subgoal or switch to the best candidate.
        choice = Choice.FIRST
        if self._subgoal is not None:
            distance = math.hypot(*self._subgoal.tolist())
            choice = choose(distance, scores[-1], scores[new], parameters.d1, parameters.d2)
        if self._subgoal is None or choice is not Choice.KEPT:
            self._subgoal = pool[new].copy()  # callers may write to the pool
        decision = Decision(self._subgoal.copy(), choice, blocked)
        self._explain = partial(
            explain, decision, self._names, parameters, scan, view, pool, features, scores, new, old
        )
        return decision

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return None if self._explain is None else self._explain()

    def _generate(self, scan: LaserScan, view: View) -> list[Floats]:
        """Random candidates in the field of view, and the target itself if it is in view and free: (N, 2) each.

        Ranges, bearings and the field of view are about the base, as in the paper: a lidar mounted off the base
        misses only a strip as wide as the mount's offset. Candidates drawn about the lidar would be denser ahead
        of the base, so a robot that should stay in place would creep forward.
        """
        config = self._config.candidates
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


def _checked(criterion: Criterion) -> Criterion:
    """Wrap a user's criterion so that it raises ReturnedError unless it gives each candidate a finite number.

    It works on copies, since it may write to its arguments.
    """
    return lambda candidates, view: checked_values(
        criterion(*deepcopy((candidates, view))), len(candidates), criterion
    )


def _in_view(point: Floats, reach: float, bearing_min: float, fov: float) -> bool:
    """Return whether a point lies in the sector [bearing_min, bearing_min + fov], within `reach` [m]."""
    x, y = point.tolist()
    off_centre = math.remainder(math.atan2(y, x) - bearing_min - fov / 2, 2 * math.pi)
    return math.hypot(x, y) <= reach and abs(off_centre) <= fov / 2


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
        check_call(config_key(f"criteria.{name}"), loaded[name], "candidates", "view")
    return loaded
