"""Many robots, each in its own world and episode, moved by one compiled call: `sim=fast`, `skid` and `gazebo` in bulk.

It takes and returns arrays and does not need Gymnasium. To the last bit, each robot sees and does what
it would if it drove alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.gym.bases import NOTHING_MOVES, ExactBases, Movers, RollingBases, Scene, SlidingBases
from lme.gym.crowds import MOST_PEOPLE, CrowdStore
from lme.gym.episodes import DrawRobot, Episodes, Results, Reward, distances
from lme.gym.kernels.crowds import look_at_movers, look_for_people
from lme.gym.kernels.steps import RUNNING, TIMEOUT, Bodies, States, look, look_by_lattice
from lme.gym.sensing import Sensing
from lme.gym.threads import Threads
from lme.gym.worlds import MOST_TASKS, WorldStore, places
from lme.perception.raycast import add_noise, beam_table
from lme.robots import Robot
from lme.simulation.crowd import SLACK
from lme.simulation.fast import FastConfig
from lme.simulation.skid.simulator import SkidConfig, outline_that_collides, warn_of_differences
from lme.types import Bools, Floats, Ints
from lme.worlds.world import MapSet, Task

ONE_BY_ONE = 'use one environment per robot instead (gym.make_vec with vectorization_mode="sync")'
Bases = ExactBases | RollingBases | SlidingBases
SAME_STEP, NEXT_STEP, DISABLED = AUTORESETS = "SameStep", "NextStep", "Disabled"  # as Gymnasium calls them


class OneByOneError(InputError):
    """A choice that the compiled step of many robots does not support."""


class Views(NamedTuple):
    """Observations of K robots.

    ranges (K, B) float32 [m], range_max without a return; targets (K, 2): goals in the robots' frames [m]; twists (K,
    2) as measured, and commands (K, 2): the last ones, as far as the robots could follow them [m/s, rad/s]; limits (K,
    4): v_max, ω_max, α_v, α_ω; boxes (K, 3): half length, half width and rounding of the collision footprint [m].
    people (K, MOST_PEOPLE, 5) float32: x, y [m], vx, vy [m/s] over ground, in the robots' frames, of the nearest people
    in sight, and 1; rows of 0 follow. Without `people`, (K, 0, 5).
    """

    ranges: NDArray[np.float32]
    targets: Floats
    twists: Floats
    commands: Floats
    limits: Floats
    boxes: Floats
    people: NDArray[np.float32]

    def of(self, chosen: Ints) -> Views:
        """Return the observations of some of the robots, in new arrays."""
        return Views._make(array[chosen] for array in self)


class Transition(NamedTuple):
    """The result of a step of N robots.

    views: the next observations. rewards (N,). terminated, truncated (N,): arrived or in contact; out of time.
    outcomes (N,): codes of `lme.gym.kernels`. ended (K,): the robots whose episode has ended, with their `last_views`
    and `results` (K). begun (M,): the robots that `views` shows at the start of an episode.
    """

    views: Views
    rewards: Floats
    terminated: Bools
    truncated: Bools
    outcomes: Ints
    ended: Ints
    last_views: Views
    results: Results
    begun: Ints


class Fleet:
    """N robots that drive side by side, each in its own world. Call `reset` first.

    Lidar and control rate are the same for all; the other values of a robot may be redrawn for each episode.
    """

    def __init__(
        self,
        map_set: MapSet,
        robot: Robot | DrawRobot,
        num_envs: int,
        config: FastConfig | SkidConfig | None = None,
        reward: Reward | None = None,
        autoreset: str = SAME_STEP,
        threads: int | None = None,
        people: bool = False,
    ) -> None:
        """autoreset: when the next episode begins after an end: "SameStep", "NextStep" instead of a motion, "Disabled".

        config: None for `sim=fast` as shipped. threads: see `Threads`. people: whether the robots observe people.
        Raises InputError for anything that the compiled step does not support.
        """
        self._episodes = Episodes(map_set, robot)
        self._config, self._reward = config or load_settings("sim/fast"), reward or Reward()
        self.robot, self.num_envs, self._autoreset = self._episodes.robot, num_envs, autoreset
        self._check()
        self._threads = Threads(threads)
        lidar = self.robot.lidar
        angles = (lidar.angle_min, lidar.angle_increment)
        self._lidar = tuple(map(float, (*lidar.mount, *angles, lidar.range_max)))
        self._people_sensor = tuple(map(float, (*angles, lidar.range_min, lidar.range_max, SLACK)))
        self._num_people = MOST_PEOPLE if people else 0
        self._table = beam_table(lidar.angle_increment, lidar.num_beams)
        self.tasks: list[Task] = []  # of the current episodes
        self._rngs: list[np.random.Generator] = [np.random.default_rng() for _ in range(num_envs)]
        self._store, self._rows = WorldStore(), np.zeros(num_envs, np.int64)
        self._places, self._bodies, self._states = places(num_envs), _bodies(num_envs), _states(num_envs)
        self._is_skid = isinstance(self._config, SkidConfig)
        self._base: Bases = _base_of(self._config, self.robot.dt, self._states)
        self._crowds: CrowdStore | None = None  # once something moves
        self._is_crowded = np.zeros(num_envs, np.bool_)  # robots in worlds where something moves
        is_exact = isinstance(self._base, ExactBases) and not self._config.disturbs_sensors
        self._sensing = None if is_exact else Sensing(self.robot, self._config, num_envs)
        self._twists = self._states.twists if is_exact else np.zeros((num_envs, 2))  # as measured
        self._distances, self._all = np.zeros(num_envs), np.arange(num_envs)
        self._slowest = np.full(num_envs, -np.inf)  # v_min of each robot [m/s]
        self._robots: list[Robot | None] = [None] * num_envs
        self._views = self._room()  # shown last
        self._over = np.zeros(num_envs, np.bool_)  # robots whose next episode has not begun

    def reset(
        self, seeds: Sequence[int | None] | None = None, world: int | None = None, mask: Bools | None = None
    ) -> Views:
        """Start an episode with every robot, in this world or in worlds drawn at random.

        seeds (N,): new random streams for the robots; None: continue the current ones. mask (N,): the robots that
        start, while the others stay as they are; None: all.
        """
        if seeds is not None and len(seeds) != self.num_envs:
            raise InputError(f"seeds has {len(seeds)} numbers: must have {self.num_envs}, one for each robot")
        chosen = self._all if mask is None or not self.tasks else np.flatnonzero(mask)
        for i in chosen.tolist():
            if seeds is not None and seeds[i] is not None:
                self._rngs[i] = np.random.default_rng(seeds[i])
        views = self._room() if chosen is self._all else self._views.of(self._all)
        self._begin(chosen, world)
        self._observe(chosen, views)
        nobody = self._all[:0]
        self._no_ends = nobody, views.of(nobody), self._results(nobody)
        self._views = views
        return views

    def step(self, commands: Floats) -> Transition:
        """Drive every robot for one control period. commands (N, 2): v [m/s] and ω [rad/s].

        Raises InputError for commands that are not finite.
        """
        commands, states, begun = self._checked(commands), self._states, np.flatnonzero(self._over)
        if len(begun):
            self._begin(begun)
        views = self._views = self._room()
        standing = np.isin(self._all, begun) if len(begun) else None
        self._observe(self._all, views, (commands, standing))
        # Rewards, also of robots that end here; those that have just begun get none.
        previous, self._distances = self._distances, distances(self._places.goals, states.poses)
        outcomes = states.outcomes.copy()
        rewards = self._reward.of(previous, self._distances, outcomes)
        rewards[begun] = 0.0
        truncated = outcomes == TIMEOUT
        terminated = (outcomes != RUNNING) & ~truncated
        ended = np.flatnonzero(outcomes)
        if not len(ended):
            return Transition(views, rewards, terminated, truncated, outcomes, *self._no_ends, begun)
        # Keep the ends before the next episodes begin.
        last_views, results = views.of(ended), self._results(ended)
        if self._autoreset == SAME_STEP:
            self._begin(ended)
            self._observe(ended, views)
            begun = ended
        else:
            self._over[ended] = True
        return Transition(views, rewards, terminated, truncated, outcomes, ended, last_views, results, begun)

    def begun(self, robots: Ints) -> dict[str, NDArray[Any]]:
        """Return Gymnasium's infos (K,) of the episodes that robots (K,) are in."""
        rows = self._rows[robots]
        return {"world": self._store.numbers[rows], "optimal_time": self._store.optimal_times[rows]}

    def _begin(self, robots: Ints, world: int | None = None) -> None:
        """Put robots (K,) at the start of their next episodes, in this world or in worlds drawn at random."""
        draws = [self._episodes.draw(self._rngs[i], world) for i in robots.tolist()]
        tasks = [task for task, _ in draws]
        self._enter(robots, tasks)
        # The bodies, where they differ from episode to episode.
        bodies, states = self._bodies, self._states
        for i, (_, robot) in zip(robots.tolist(), draws, strict=True):
            if robot is not self._robots[i]:
                self._robots[i], outline = (
                    robot,
                    outline_that_collides(robot) if self._is_skid else robot.footprint,
                )
                bodies.limits[i], bodies.boxes[i] = robot.limits.bounds, outline.box
                bodies.reaches[i], self._slowest[i] = outline.circumscribed_radius, robot.limits.v_min
        # All else begins at rest at the start.
        states.poses[robots] = [task.start for task in tasks]
        for array in (states.twists, states.times, states.lengths, states.steps, states.outcomes, self._over):
            array[robots] = 0
        for i, (task, robot) in zip(robots.tolist(), draws, strict=True):
            if self._sensing:
                self._sensing.begin(i, self._rngs[i], task.goal)
            self._is_crowded[i] = len(task.world.movers) > 0
            if self._is_crowded[i]:
                self._begin_among_movers(i, task, robot)
            else:
                self._base.begin(i, robot, self._rngs[i], states.poses[i])
        states.clocks[robots] = np.where(self._places.rules[robots, 2] > 0.0, np.nan, 0.0)
        self._distances[robots] = distances(self._places.goals[robots], states.poses[robots])

    def _begin_among_movers(self, i: int, task: Task, robot: Robot) -> None:
        """Start an episode of robot i in a world where something moves."""
        if self._crowds is None:
            self._crowds = CrowdStore(self.num_envs)
            self._among_movers = _base_among_movers(self._config, robot.dt, self.num_envs)
        fastest = self._crowds.begin(i, task.world)
        self._among_movers.begin(i, robot, self._rngs[i], self._states.poses[i], fastest)

    def _enter(self, robots: Ints, tasks: list[Task]) -> None:
        """Give robots (K,) their tasks."""
        if not self.tasks:
            self.tasks = list(tasks)
        for i, task in zip(robots.tolist(), tasks, strict=True):
            self.tasks[i] = task
        if len(self._store.tasks) > MOST_TASKS + self.num_envs:
            self._store, robots = WorldStore(), self._all
        rows = self._rows[robots] = self._store.rows([self.tasks[i] for i in robots.tolist()])
        for array, values in zip(self._places, self._store.places(rows), strict=True):
            array[robots] = values

    def _observe(self, robots: Ints, views: Views, motion: tuple[Floats, Bools | None] | None = None) -> None:
        """Write the observations of robots (K,) into their rows of the views, after a motion if there is one.

        motion: commands (N, 2), and which robots stand still (N,) if any do. Threads share the robots.
        """
        states, store, sensing = self._states, self._store, self._sensing
        scene = self._places, store.obstacles
        moving: Scene = (states, self._bodies, *scene)
        sensor, ranges = (self._lidar, self._table, views.ranges), views.ranges
        movers = self._crowds.packed() if self._crowds else NOTHING_MOVES

        def work(part: Ints) -> None:
            if self._crowds is None:
                drive_and_see(part, self._base, NOTHING_MOVES)
                return
            is_crowded = self._is_crowded[part]
            drive_and_see(part[~is_crowded], self._base, NOTHING_MOVES)
            if is_crowded.any():
                drive_and_see(part[is_crowded], self._among_movers, movers)

        def drive_and_see(part: Ints, base: Bases, movers: Movers) -> None:
            encoders, (crowds, _) = base.encoders, movers
            if motion is not None:
                commands, standing = motion
                driving = part if standing is None else part[~standing[part]]
                base.advance(driving, moving, commands, movers)
            look(part, encoders.scans, *scene, *sensor, views.targets)
            for world, members in store.by_lattice(self._rows[part]):
                look_by_lattice(part[members], encoders.scans, *sensor, world.grid, world.lattice)
            if crowds is not None:
                look_at_movers(part, encoders.scans, *sensor, crowds)
            if sensing is None:
                self._add_noise(part, ranges)
            else:
                sensing.ranges(part, self._rngs, encoders.twists, ranges)
                sensing.motion(part, states, self._places.goals, encoders, views.targets, self._twists)
            if self._num_people:
                views.people[part] = 0.0
            if self._num_people and crowds is not None:
                sensors = encoders.scans, states.poses, self._lidar[:3], self._people_sensor
                look_for_people(part, *sensors, ranges, views.people, crowds)

        self._threads.run(work, robots)
        columns = (self._twists, self._base.encoders.commands, self._bodies.limits, self._bodies.boxes)
        for array, values in zip(views[2:6], columns, strict=True):
            if robots is self._all:
                array[:] = values
            else:
                array[robots] = values[robots]
        crowded = robots[self._is_crowded[robots]]
        if len(crowded):
            views.commands[crowded] = self._among_movers.encoders.commands[crowded]

    def _add_noise(self, robots: Ints, ranges: NDArray[np.float32]) -> None:
        """Add the lidar's noise, which each robot draws from its own stream."""
        lidar = self.robot.lidar
        if lidar.noise_std == 0.0:
            return
        noise = np.empty(lidar.num_beams, np.float32)
        for i in robots.tolist():
            self._rngs[i].standard_normal(dtype=np.float32, out=noise)
            add_noise(ranges[i], noise, float(lidar.noise_std), float(lidar.range_max))

    def _room(self) -> Views:
        """Return arrays for the observations of all robots."""
        n = self.num_envs
        ranges, pairs = np.empty((n, self.robot.lidar.num_beams), np.float32), np.empty((3, n, 2))
        people = np.empty((n, self._num_people, 5), np.float32)
        targets, twists, commands = pairs
        return Views(ranges, targets, twists, commands, np.empty((n, 4)), np.empty((n, 3)), people)

    def _results(self, robots: Ints) -> Results:
        store, states, rows = self._store, self._states, self._rows[robots]
        clocks = np.where(np.isnan(states.clocks[robots]), 0.0, states.clocks[robots])
        times = np.minimum(states.times[robots] - clocks, self._places.rules[robots, 1])
        return Results(
            states.outcomes[robots],
            store.numbers[rows],
            times,
            states.lengths[robots],
            states.steps[robots],
            store.optimal_times[rows],
        )

    def _checked(self, commands: Floats) -> Floats:
        if not self.tasks:
            raise InputError("the robots have no episodes yet: call reset before step")
        commands = np.ascontiguousarray(commands, dtype=np.float64)
        if commands.shape != (self.num_envs, 2):
            raise InputError(f"the commands have shape {commands.shape}: must be {(self.num_envs, 2)}")
        if not np.isfinite(commands).all():
            wrong = int(np.argmin(np.isfinite(commands).all(axis=1)))
            raise InputError(f"the command of robot {wrong} is {commands[wrong].tolist()}: must be finite")
        if self._autoreset == DISABLED and self._over.any():
            raise InputError(
                f"the episode of robot {int(np.argmax(self._over))} has ended: must be reset with a mask before step"
            )
        return np.column_stack((np.maximum(commands[:, 0], self._slowest), commands[:, 1]))

    def _check(self) -> None:
        """Raise InputError for a lidar whose scan is made of something else, and for the response of a real robot."""
        if self.num_envs < 1:
            raise InputError(f"num_envs is {self.num_envs}: must be at least 1")
        if self._autoreset not in AUTORESETS:
            raise InputError(f"autoreset is {self._autoreset!r}: must be one of {', '.join(AUTORESETS)}")
        lidar = self.robot.lidar
        for key in ("native_beams", "shadow_angle", "cloud"):
            value = getattr(lidar, key)
            if value is not None:
                raise OneByOneError(
                    f"robot.lidar.{key} is {value}: the compiled step of many robots does not support it, {ONE_BY_ONE}"
                )
        if isinstance(self._config, SkidConfig):
            warn_of_differences(self.robot)
        if isinstance(self._config, SkidConfig) and self.robot.response is not None:
            raise OneByOneError(
                f"robot.response is set in robot {self.robot.name}: the compiled step of many robots has only wheels "
                f"that slide (robot.drivetrain), {ONE_BY_ONE}"
            )


def _base_of(config: FastConfig | SkidConfig, dt: float, states: States) -> Bases:
    """Return the base of robots with these states, in worlds where nothing moves."""
    if isinstance(config, SkidConfig):
        return SlidingBases(config, dt, len(states.times))
    return (
        RollingBases(config, dt, len(states.times))
        if config.needs_substeps
        else ExactBases(config, dt, states)
    )


def _base_among_movers(config: FastConfig | SkidConfig, dt: float, n: int) -> RollingBases | SlidingBases:
    """Return the base of N robots in worlds where something moves."""
    if isinstance(config, SkidConfig):
        return SlidingBases(config, dt, n, among_movers=True)
    return RollingBases(config, dt, n)


def _bodies(n: int) -> Bodies:
    return Bodies(limits=np.zeros((n, 4)), boxes=np.zeros((n, 3)), reaches=np.zeros(n))


def _states(n: int) -> States:
    return States(
        poses=np.zeros((n, 3)),
        twists=np.zeros((n, 2)),
        times=np.zeros(n),
        clocks=np.zeros(n),
        lengths=np.zeros(n),
        steps=np.zeros(n, dtype=np.int64),
        outcomes=np.zeros(n, dtype=np.int64),
    )
