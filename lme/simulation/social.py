"""Social measures of an episode, named and defined as in HuNavSim and by Francis et al.

Pérez-Higueras, Otero, Caballero and Merino 2023, "HuNavSim", DOI 10.1109/LRA.2023.3316072, whose evaluator also has
the measures of SEAN 2.0 and SocNavBench; Francis et al. 2025, DOI 10.1145/3700599. docs/understand/social.md gives each
definition. People are all discs that move. Distances are from the robot's outline to a person's disc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from lme.robots import Robot
from lme.simulation.simulator import Simulator, State
from lme.types import Floats, Guidance, Observation, Twist
from lme.worlds.world import Task

INTIMATE, PERSONAL = 0.45, 1.2  # [m] Hall 1966, as in HuNavSim

_TOUCH = 0.02  # [m] a contact with a person if the person is this near, as in HuNavSim


@dataclass(frozen=True, slots=True)
class SocialMeasures:
    """Columns of an episode with people.

    robot_on_person_collision, person_on_robot_collision: 1 or 0. minimum_distance_to_people_m: NaN if nobody came.
    intimate_space_intrusions, personal_space_intrusions: shares of the time with the nearest person within INTIMATE,
    and from there to PERSONAL. path_irregularity_rad: mean angle between heading and the direction to the goal.
    time_against_alone: time to goal relative to the same drive without people; NaN unless both arrived.
    """

    robot_on_person_collision: float
    person_on_robot_collision: float
    minimum_distance_to_people_m: float
    intimate_space_intrusions: float
    personal_space_intrusions: float
    path_irregularity_rad: float
    time_against_alone: float = math.nan


class Company:
    """Measures one episode of a simulator: an observer for `lme.navigation.episode.run_episode`."""

    def __init__(self, robot: Robot, simulator: Simulator) -> None:
        self._box = robot.footprint.box
        self._simulator = simulator
        self._state: State | None = None
        self._closest = math.inf
        self._intimate = self._personal = self._total_turn = 0.0
        self._decisions = 0

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Record the motion since the last decision, and the heading."""
        self._moved(state)
        self._total_turn += abs(math.atan2(observation.target[1], observation.target[0]))
        self._decisions += 1

    def ended(self, observation: Observation, state: State) -> None:
        """Record the last motion."""
        self._moved(state)

    def _moved(self, state: State) -> None:
        duration = state.time - self._state.time if self._state else 0.0
        gaps = distances(state.travel, self._box, *self._simulator.people, duration)
        self._closest = min(self._closest, float(gaps.min()))
        self._intimate += duration * float((gaps < INTIMATE).mean())
        self._personal += duration * float(((gaps >= INTIMATE) & (gaps < PERSONAL)).mean())
        self._state = state

    def measures(self) -> SocialMeasures:
        """Return the measures, once the episode has ended."""
        state = self._state
        assert state is not None
        robot_fault, person_fault = self._fault(state) if state.contact else (0.0, 0.0)
        per_second = 1.0 / state.time if state.time > 0.0 else math.nan
        return SocialMeasures(
            robot_on_person_collision=robot_fault,
            person_on_robot_collision=person_fault,
            minimum_distance_to_people_m=self._closest if math.isfinite(self._closest) else math.nan,
            intimate_space_intrusions=per_second * self._intimate,
            personal_space_intrusions=per_second * self._personal,
            path_irregularity_rad=self._total_turn / self._decisions if self._decisions else math.nan,
        )

    def _fault(self, state: State) -> tuple[float, float]:
        """Attribute a contact: (1, 0) if the robot closed the gap at least as fast as the person, else (0, 1).

        Returns (0, 0) for a contact with a wall. A robot that stands still or drives away is never to blame.
        """
        circles, velocities = self._simulator.people
        pose = np.array([state.pose])
        gaps = [distances(pose, self._box, circle[None], velocities[:1], 0.0)[0] for circle in circles]
        if not gaps or min(gaps) > _TOUCH:
            return 0.0, 0.0
        k = int(np.argmin(gaps))
        robot_speed, person_speed = closing_speeds(state, self._box, circles[k], velocities[k])
        return (1.0, 0.0) if robot_speed > 0.0 and robot_speed >= person_speed else (0.0, 1.0)


def without_people(task: Task) -> Task:
    """Return the same task without people in its world; doors and static obstacles stay."""
    doors = tuple(mover for mover in task.world.movers if mover.radius is None)
    return replace(task, world=replace(task.world, movers=doors))


def closing_speeds(
    state: State, box: tuple[float, float, float], circle: Floats, velocity: Floats
) -> tuple[float, float]:
    """Speeds at which the robot and the person each close the gap between them, along the line of contact [m/s]."""
    x, y, yaw = state.pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    dx, dy = circle[0] - x, circle[1] - y
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    # Nearest point of the box without its rounding, and the direction from it to the person.
    touch = min(max(ahead, -box[0]), box[0]), min(max(left, -box[1]), box[1])
    normal = np.array([ahead - touch[0], left - touch[1]])
    length = float(np.hypot(*normal))
    if length == 0.0:  # the person's middle is inside the outline
        normal, length = np.array([ahead, left]), max(math.hypot(ahead, left), 1e-9)
    normal /= length
    # Velocity of the outline where it touches, v + ω × r, and of the person, both along the normal.
    contact = np.array(touch) + box[2] * normal
    v, omega = state.twist
    robot_speed = (v - omega * contact[1]) * normal[0] + omega * contact[0] * normal[1]
    person_speed = -(
        (cos * velocity[0] + sin * velocity[1]) * normal[0]
        + (cos * velocity[1] - sin * velocity[0]) * normal[1]
    )
    return float(robot_speed), float(person_speed)


@njit(cache=True, error_model="numpy")
def distances(
    travel: Floats, box: tuple[float, float, float], circles: Floats, velocities: Floats, duration: float
) -> Floats:
    """Distance from the outline to the nearest person at each pose of a motion [m], 0 in contact: (K,).

    travel (K, 3); box (half_length, half_width, rounding) [m]; circles (P, 3) and velocities (P, 2): at the end of the
    motion, which took `duration` [s]. Infinite if there is nobody.
    """
    nearest = np.full(len(travel), np.inf)
    for k in range(len(travel)):
        # Time from this pose to the end of the motion, by which the people are moved back.
        remaining = duration * (len(travel) - 1 - k) / len(travel)
        cos, sin = math.cos(travel[k, 2]), math.sin(travel[k, 2])
        for i in range(len(circles)):
            dx = circles[i, 0] - remaining * velocities[i, 0] - travel[k, 0]
            dy = circles[i, 1] - remaining * velocities[i, 1] - travel[k, 1]
            # Distance beyond the sides of the box, in the robot frame.
            x = max(abs(cos * dx + sin * dy) - box[0], 0.0)
            y = max(abs(cos * dy - sin * dx) - box[1], 0.0)
            nearest[k] = min(nearest[k], max(math.hypot(x, y) - box[2] - circles[i, 2], 0.0))
    return nearest
