"""LME+: subgoals by expected time, from scans, twist and the target's position alone (docs/understand/lme_plus.md)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_robot, to_world
from lme.guides.lme.candidates import CandidateConfig, sample
from lme.guides.lme.criteria import View
from lme.guides.lme.explanation import Decision, Explanation, explain
from lme.guides.lme.maintenance import Choice, choose
from lme.guides.lme.score import Parameters
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters
from lme.guides.lme_plus.criteria import CRITERIA, NARROW_SHARE, Perception, ranked
from lme.guides.lme_plus.learned_times import OTHER_TARGET, LearnedTimes, StuckPlaces
from lme.guides.lme_plus.memory import Memory
from lme.guides.lme_plus.reasons import with_way
from lme.guides.lme_plus.travel import NARROW, Field, Travel, TravelConfig, apart
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Pose

_NAMES = tuple(CRITERIA)
_NO_POINTS = np.empty((0, 2))
CANDIDATES = 100  # random ones
RANGE = 5.0  # [m] within which they are drawn
_MAX_AGE = 3  # decisions with the same expected times, if nobody is near and the target does not move
_PASSAGE_AHEAD = 1.0  # [m] ahead of the robot, where it tries a narrow passage
_DOUBLING_TIME = 10.0  # [s] tried before narrow passages, after which they are expected to take twice as long
_MAX_DOUBLINGS = 5.0  # greatest number of these doublings
_STANDS = 0.05  # [m/s] below this speed the robot counts as standing
_SAME_TARGET = 0.1  # [m] by which the target may move before the times are recomputed


@dataclass(slots=True)
class LmePlusParts:
    """Parts of the method; False leaves one out, for an ablation."""

    memory: bool
    random: bool
    structured: bool
    narrow: bool
    stuck: bool
    learned: bool
    people: bool


@dataclass(slots=True)
class LmePlusConfig:
    """Range of the memory, distance to obstacles, expected speed near obstacles and people, and parameters.

    weight_set: its own. parameters: by name; {}: those of the weight set.
    """

    reach: float
    margin: float
    travel: TravelConfig
    parts: LmePlusParts
    weight_set: str
    parameters: dict[str, float]

    def __post_init__(self) -> None:
        require("reach", self.reach, above=0.0)
        require("margin", self.margin, at_least=0.0)


class LmePlus:
    """The successor of LME: candidates scored by expected time (docs/understand/lme_plus.md).

    The parameters are a weight for each criterion, d1 [m], and d2, in the unit of the score.
    """

    Config = LmePlusConfig

    def __init__(self, config: LmePlusConfig, robot: Robot) -> None:
        self._robot = robot
        self._config, parts = config, config.parts
        parameters = config.parameters or learned_parameters(PUBLISHED, config.weight_set)
        self._parameters = Parameters.from_mapping(parameters, _NAMES)
        self._candidates = CandidateConfig(
            number=CANDIDATES if parts.random else 1, max_range=RANGE, distribution="polar", target=True
        )
        self._travel = Travel(config.travel, robot, config.reach, config.margin, parts.narrow)
        self.reset(np.random.default_rng(0))

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self._rng = rng
        parts = self._config.parts
        self._memory = Memory(self._robot, self._config.reach, parts.memory, parts.people)
        self._learned = LearnedTimes()
        self._learned_target: Floats | None = None  # the target, in the carried frame
        self._field: Field | None = None
        self._age = 0  # decisions made with the field
        self._time_at_passages = 0.0  # [s] spent before narrow passages on the way to the target
        self._stuck = StuckPlaces(self._robot.dt)  # on the way to the target
        self.sight: Perception | None = None  # of the last decision
        self._subgoal: Floats | None = None  # in the carried frame
        self._explain: Callable[[], Explanation] | None = None  # the last decision

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal with the least expected time, the known obstacle points, and the fastest way."""
        config, robot, parameters, memory = self._config, self._robot, self._parameters, self._memory
        # Take in the scan, and find the fastest way.
        memory.see(observation)
        pose, points = memory.pose, memory.known
        field = self._times(to_world(observation.target, pose), pose)
        route, ahead = field.descent(pose, self._reach(observation))
        self._time_at_passages += robot.dt if ahead < _PASSAGE_AHEAD else 0.0
        margin = config.margin * (NARROW_SHARE if math.isfinite(ahead) else 1.0)
        self.sight = sight = Perception(points, pose, field, robot.footprint.box, margin, robot.v_max)
        # Score the candidates and, in the last column, the old subgoal.
        subgoal = None if self._subgoal is None else to_robot(self._subgoal, pose)
        pool = self._generate(observation, route, subgoal)
        candidates = len(pool) - (subgoal is not None)
        old = None if subgoal is None else candidates
        features, scores, new, blocked = ranked(pool, sight.plain(), parameters.weights, candidates)
        # Keep the old subgoal or switch to the best candidate.
        choice = Choice.FIRST
        if subgoal is not None:
            distance = math.hypot(*subgoal.tolist())
            choice = choose(distance, scores[-1], scores[new], parameters.d1, parameters.d2)
        if subgoal is None or choice is not Choice.KEPT:
            self._subgoal = to_world(pool[new], pose)
            subgoal = to_robot(self._subgoal, pose)
        # View for the explanation: the points of the scan and the target, without a history or a blockage.
        decision, scan = Decision(subgoal, choice, blocked), observation.scan
        radius = robot.footprint.inscribed_radius + config.margin
        view = View(memory.seen, observation.target, radius, _NO_POINTS, None, "every")
        told = partial(explain, decision, _NAMES, parameters, scan, view, pool, features, scores, new, old)
        half_width = robot.footprint.inscribed_radius
        self._explain = partial(with_way, told, route, ahead, points, half_width, self._reach(observation))
        # The robot is stuck if it stands, nobody is near and no candidate is reachable.
        stands = abs(observation.ramp_start.v) < _STANDS and not len(memory.people)
        if config.parts.stuck and blocked and stands and len(route):
            self._stuck.wait(to_world(route[0], pose))
        return Guidance(subgoal, None, choice.switched, blocked, points, route)

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return None if self._explain is None else self._explain()

    def _reach(self, observation: Observation) -> float:
        """Greatest distance of a candidate [m]."""
        return min(self._candidates.max_range, observation.scan.range_max)

    def _times(self, target: Floats, pose: Pose) -> Field:
        """Return the expected times of the last decisions, or new ones if those are old or of another target."""
        memory, field = self._memory, self._field
        self._age += 1
        old = self._age >= _MAX_AGE or len(memory.people) > 0
        if field is None or old or apart(target, field.target) > _SAME_TARGET:
            learned, position = self._learned_of(target), np.array(pose[:2])
            narrow_factor = NARROW * 2.0 ** min(self._time_at_passages / _DOUBLING_TIME, _MAX_DOUBLINGS)
            inputs = memory.points, target, position, memory.people, learned, narrow_factor, self._stuck.rows
            self._field = field = self._travel.field(*inputs)
            self._age = 0
        return field

    def _learned_of(self, target: Floats) -> LearnedTimes:
        """Return the times learned for ways to a target; all is forgotten if this is another one."""
        is_new_target = self._learned_target is None or apart(target, self._learned_target) > OTHER_TARGET
        if is_new_target:
            self._time_at_passages = 0.0
            self._stuck.forget()
        if is_new_target or not (self._config.parts.memory and self._config.parts.learned):
            self._learned, self._learned_target = LearnedTimes(), target
        return self._learned

    def _generate(self, observation: Observation, route: Floats, subgoal: Floats | None) -> Floats:
        """Random candidates all around, places on the fastest way, the target if it is in range; last the subgoal."""
        reach = self._reach(observation)
        parts = [sample(self._rng, self._candidates, reach, -math.pi, 2 * math.pi)]
        if self._config.parts.structured:
            parts.append(route)
        if math.hypot(*observation.target.tolist()) <= reach:
            parts.append(observation.target[None])
        if subgoal is not None:
            parts.append(subgoal[None])
        return np.concatenate(parts)
