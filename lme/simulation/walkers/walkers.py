"""People of a world: their destinations, and the velocities that a model of walking makes of them.

Nothing here is random: the people and their paths are drawn together with the world.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lme.simulation.walkers.kernels import next_waypoints, orca, social_force
from lme.types import Floats, Pose
from lme.worlds.movers import ORCA, REPEATS, Mover
from lme.worlds.world import World

if TYPE_CHECKING:
    from lme.simulation.crowd import Crowd

PERIOD = 0.1  # [s] between two decisions of a person
HASTE = 1.3  # greatest speed of a person, relative to the wanted one (Helbing & Molnár 1995)


class Walkers:
    """The people among the movers of a world. Each waits at the start of its path until `walk` is called."""

    def __init__(
        self, movers: Sequence[Mover], chosen: Sequence[int], world: World, robot_radius: float
    ) -> None:
        """chosen: indices of the people. robot_radius: of the disc that represents the robot [m]."""
        self._indices = np.array(chosen, dtype=np.int64)
        people = [movers[i] for i in chosen]
        self._other_indices = np.array(
            [i for i, mover in enumerate(movers) if mover.radius is not None and not mover.walks],
            dtype=np.int64,
        )
        self._other_radii = np.array([movers[i].radius for i in self._other_indices])
        self._by_orca = np.array([mover.motion == ORCA for mover in people])
        self._traits = np.array(
            [
                (mover.radius, mover.speed, HASTE * mover.speed, mover.sees_robot, mover.start_after)
                for mover in people
            ]
        )
        self._waypoints = np.vstack([mover.path[:, :2] for mover in people])
        self._first = np.cumsum([0, *(len(mover.path) for mover in people)])
        self._repeats = np.array([REPEATS.index(mover.repeat) for mover in people])
        self._plan = np.column_stack([np.zeros(len(people)), np.ones(len(people)), np.zeros(len(people))])
        self._circles = np.ascontiguousarray(world.circles, dtype=np.float64)
        self._edges = world.edges
        self._robot_radius = robot_radius
        self._velocities = np.zeros((len(people), 2))
        self._robot: Pose | None = None
        self._time, self._decision_time = 0.0, -math.inf

    def go_on(self, former: Walkers, pairs: Mapping[int, int]) -> None:
        """Continue from other walkers: take over their time, and the plans of the people who are in both.

        pairs: for each mover that stays, its current and its former index.
        """
        self._time, self._decision_time, self._robot = former._time, former._decision_time, former._robot
        rows = {int(i): row for row, i in enumerate(former._indices)}
        for row, i in enumerate(self._indices.tolist()):
            if i in pairs:
                self._plan[row] = former._plan[rows[pairs[i]]]
                self._velocities[row] = former._velocities[rows[pairs[i]]]

    def decide(self, crowd: Crowd, robot: Pose, dt: float) -> None:
        """Choose new velocities, every `PERIOD`. robot: the pose of its base now; dt: since the last call [s]."""
        previous, self._robot = self._robot, robot
        if self._time - self._decision_time < PERIOD - 1e-9:
            return
        # Wanted velocities, from the waypoints of each person.
        elapsed = min(self._time - self._decision_time, self._time)
        self._decision_time = self._time
        positions = crowd.poses[self._indices, :2]
        state = (positions, self._velocities)
        preferred = next_waypoints(
            positions,
            self._velocities,
            self._traits,
            self._waypoints,
            self._first,
            self._repeats,
            self._plan,
            self._time,
            elapsed,
        )
        # New velocities by the model of each person; both models run only if both are in use.
        moving_discs = self._moving(crowd, robot, previous or robot, dt)
        edges = np.vstack([self._edges, crowd.edges]) if len(crowd.edges) else self._edges
        arguments = (*state, preferred, self._traits, moving_discs, self._circles, edges, PERIOD)
        if self._by_orca.all():
            self._velocities = orca(*arguments)
        elif not self._by_orca.any():
            self._velocities = social_force(*arguments)
        else:
            self._velocities = np.where(self._by_orca[:, None], orca(*arguments), social_force(*arguments))

    def walk(self, poses: Floats, velocities: Floats, dt: float) -> None:
        """Move the people in the poses (M, 3) of all movers by `dt` [s]; velocities (M, 2) become theirs."""
        poses[self._indices, :2] += dt * self._velocities
        velocities[self._indices] = self._velocities
        self._time += dt

    def _moving(self, crowd: Crowd, robot: Pose, previous: Pose, dt: float) -> Floats:
        """Rows (1 + O, 5) of x, y, vx, vy, radius: first the robot, then the other discs that move."""
        velocity = ((robot.x - previous.x) / dt, (robot.y - previous.y) / dt)
        is_present = crowd.present[self._other_indices]
        positions, speeds = crowd.poses[self._other_indices, :2], crowd.velocities[self._other_indices]
        discs = np.column_stack([positions, speeds, self._other_radii])[is_present]
        return np.vstack([[robot.x, robot.y, *velocity, self._robot_radius], discs])
