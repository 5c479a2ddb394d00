"""The shortest path on a map of the obstacles seen so far or on the true map, by costs of navfn or GlobalPlanner."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lme.errors import argument_error, require
from lme.geometry.fan import fan_blocked
from lme.geometry.frames import to_robot, to_world
from lme.geometry.polyline import evenly_spaced
from lme.grids.obstacle_grid import HIGHEST, INSCRIBED, TOUCHING, Costs
from lme.guides.global_path.kernels import Cell, departs, nearest_passable, search, straighten, trace
from lme.mapping.costmap import Costmap, CostmapConfig, ends_of, stamp
from lme.mapping.map_clock import MapClock
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Bools, Floats, Guidance, Ints, Observation, Pose
from lme.worlds.world import World

MAPS = ("observed", "known")

# Navfn's cost of a cell (its COST_NEUTRAL and COST_FACTOR): near obstacles up to five times as high.
_NEUTRAL, _FACTOR = 50.0, 0.8
_TABLE = np.where(np.arange(256) < INSCRIBED, _NEUTRAL + _FACTOR * np.arange(256), np.inf)

_ORIGIN = np.zeros(2)
_SPACING_M = 0.05  # between points of a path
_SEARCH_WINDOW = 40  # [points] search window for the robot's next position on the path
_ROUNDED = 0.01  # [m] steps of the inflation radius


@dataclass(slots=True)
class GlobalPathConfig:
    """Map, search, rate of planning and distance of the subgoal."""

    global_map: str
    costmap: CostmapConfig
    heuristic_weight: float
    replan_rate: float
    lookahead: float

    def __post_init__(self) -> None:
        if self.global_map not in MAPS:
            raise argument_error(f"global_map is {self.global_map!r}: must be one of {', '.join(MAPS)}")
        require("heuristic_weight", self.heuristic_weight, at_least=0.0, at_most=1.0)
        require("replan_rate", self.replan_rate, above=0.0)
        require("lookahead", self.lookahead, above=0.0)


@dataclass(slots=True)
class _Route:
    """A planned path in the odometry frame, and the robot's position on it."""

    points: Floats  # (K, 2) [m], evenly spaced, from the robot to the target
    reaches_target: bool  # False: no path exists, the points are a straight line
    forbidden: Bools  # (K,) at the time of planning
    index: int = 0  # index of the point nearest to the robot


class GlobalPath:
    """Dijkstra or A* on a costmap with replanning, like navfn in ROS move_base.

    Cell costs are those of navfn (Konolige & Marder-Eppstein, docs.ros.org/en/noetic/api/navfn). Unlike navfn, it
    does not interpolate between cells; it replaces pieces of the path by straight lines that cost no more.
    """

    Config: ClassVar[type[GlobalPathConfig]] = GlobalPathConfig

    def __init__(self, config: GlobalPathConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._period = max(1, round(robot.control_rate / config.replan_rate))
        self.cell_costs = _TABLE  # what the search pays for a cell of each cost
        self._world: tuple[World, Pose] | None = None
        self._solved: tuple[Costs, Cell, Cell, NDArray[Any] | None] | None = None  # see `_solution`
        self._clock = MapClock(config.costmap.update_rate, robot.dt)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map and path."""
        self._clock.reset(rng)
        self._world = None
        self.costmap: Costmap | None = None
        self._route: _Route | None = None
        self._age = 0  # [steps] since the last plan

    def read_map(self, world: World, start: Pose) -> None:
        """Keep the true map for `global_map: known`."""
        self._world = (world, start)

    def guide(self, observation: Observation) -> Guidance:
        """Return the path from the robot to the target; the subgoal is the farthest point on it in sight.

        If no path exists, the path is the straight line and the subgoal is the robot's position. Raises
        InputError if the true map is needed and none was given.
        """
        costmap = self._update_costmap(observation)
        previous, self._age = self._route, self._age + 1
        due = previous is None or self._age >= self._period
        if due or (previous is not None and previous.reaches_target and self._obstructed(previous, costmap)):
            self._route, self._age = self._plan(observation, costmap), 0
        route = self._route
        assert route is not None
        # The robot's position on the route: the nearest point from the last position on.
        pose, window = observation.odometry, route.points[route.index : route.index + _SEARCH_WINDOW]
        nearest = int(np.hypot(window[:, 0] - pose.x, window[:, 1] - pose.y).argmin())
        route.index = min(route.index + nearest, len(route.points) - 2)
        # A new route is a switch if it departs from the old one by more than the robot's width.
        switched = (
            previous is not None
            and previous is not route
            and departs(route.points, previous.points[previous.index :], 2.0 * self._robot.r)
        )
        ahead = to_robot(route.points[route.index + 1 :], pose)
        path = np.vstack([_ORIGIN, ahead])
        subgoal = self._farthest_visible(path, observation) if route.reaches_target else _ORIGIN
        return Guidance(subgoal, path, switched, not route.reaches_target)

    def _update_costmap(self, observation: Observation) -> Costmap:
        """Return the map; an observed one is rebuilt first if it is due."""
        if self.costmap is None:
            self.costmap = self._new_costmap(to_world(observation.target, observation.odometry))
        if self._config.global_map == "observed":
            map_input = self._clock.due(observation)
            if map_input is not None:
                self.costmap.observe(map_input)
        return self.costmap

    def _new_costmap(self, goal: Floats) -> Costmap:
        """Create the map before the first scan: empty, or the true one."""
        if self._config.global_map == "observed":
            return Costmap(self._config.costmap, self._robot, goal[None])
        if self._world is None:
            raise argument_error(
                "global_map is 'known', but no map was given: must be 'observed', or call read_map after reset"
            )
        costmap = Costmap(self._config.costmap, self._robot, np.vstack([goal, ends_of(*self._world)]))
        costmap.draw(*self._world)
        return costmap

    def _obstructed(self, route: _Route, costmap: Costmap) -> bool:
        """Return whether a point of the path ahead has become forbidden since planning."""
        forbidden = costmap.forbidden(route.points[route.index :])
        return bool((forbidden & ~route.forbidden[route.index :]).any())

    def _plan(self, observation: Observation, costmap: Costmap) -> _Route:
        """Plan a new route on the current map."""
        if self._config.global_map == "observed" or self._route is None:
            costmap.refresh()
        robot = np.array(observation.odometry[:2])
        target = to_world(observation.target, observation.odometry)
        corners = self._corners(costmap, robot, target)
        line = np.vstack([robot, target]) if corners is None else corners
        points = self._points(line)
        return _Route(points, corners is not None, costmap.forbidden(points))

    def _corners(self, costmap: Costmap, robot: Floats, target: Floats) -> Floats | None:
        """Corners (C, 2) [m] of the cheapest path; None if there is none.

        From a forbidden start it leads straight to the nearest passable cell, and likewise to a forbidden target;
        it ends at that cell if the robot would touch an obstacle at the target.
        """
        begin, end = costmap.cell(robot), costmap.cell(target)
        window = costmap.window([begin, end])
        low = (window[0].start, window[1].start)
        costs = costmap.costs[window].copy()
        begin, end = (begin[0] - low[0], begin[1] - low[1]), (end[0] - low[0], end[1] - low[1])
        cells = self._solution(costs, begin, end)
        if cells is None:
            return None
        corners = costmap.points(cells + np.array(low))
        touching = costs[end] == TOUCHING
        return np.vstack([robot, corners] if touching else [robot, corners, target])

    def _solution(self, costs: Costs, begin: Cell, end: Cell) -> NDArray[Any] | None:
        """Return what `_solve` gives; the last one again while nothing has changed."""
        last = self._solved
        if last is None or (begin, end) != last[1:3] or not np.array_equal(costs, last[0]):
            last = self._solved = costs, begin, end, self._solve(costs, begin, end)
        return last[3]

    def _solve(self, costs: Costs, begin: Cell, end: Cell) -> NDArray[Any] | None:
        """Corners (C, 2) [cells] of the cheapest path from `begin` to `end`, without these; None if there is none."""
        start = nearest_passable(costs, self.cell_costs, begin, end)
        goal = nearest_passable(costs, self.cell_costs, end, begin)
        if start[0] < 0:
            return None
        g = search(costs, self.cell_costs, start, goal, self._config.heuristic_weight)
        cells = trace(g, costs, self.cell_costs, start, goal)
        if len(cells) == 0:
            return None
        corners = straighten(cells, g, costs, self.cell_costs)
        corners = corners[1:] if start == begin else corners
        return corners[:-1] if goal == end else corners

    def _points(self, line: Floats) -> Floats:
        """Points (K, 2) [m] of the path along a line (C, 2) of corners."""
        return evenly_spaced(line, _SPACING_M)

    def _farthest_visible(self, path: Floats, observation: Observation) -> Floats:
        """Farthest path point within the lookahead that the robot can reach in a straight line: (2,) [m].

        The corridor has the radius of the padded robot, else of the robot, else of its inner disc, limited to the
        current clearance. If no point is in sight, the point one robot radius along the path is taken.
        """
        robot, padding = self._robot, self._config.costmap.footprint_padding
        ahead = path[1 : 1 + max(1, round(self._config.lookahead / _SPACING_M))]
        points = obstacle_points(observation.scan, robot.lidar.mount)
        room = math.sqrt((points * points).sum(axis=1).min(initial=math.inf)) * (1.0 - 1e-9)
        for radius in (robot.r + padding, robot.r, robot.footprint.inscribed_radius):
            free = np.flatnonzero(~fan_blocked(_ORIGIN, ahead, points, min(radius, room)))
            if len(free):
                return np.array(ahead[free[-1]])
        step = min(math.ceil(robot.r / _SPACING_M), len(ahead))
        return np.array(ahead[step - 1])


@dataclass(slots=True)
class GlobalPlannerConfig(GlobalPathConfig):
    """Costs of GlobalPlanner, and the inflation at full speed, besides the settings of GlobalPath."""

    neutral_cost: float
    cost_factor: float
    lethal_cost: float
    fast_inflation_radius: float
    full_speed: float

    def __post_init__(self) -> None:
        GlobalPathConfig.__post_init__(self)  # super() fails in a dataclass with slots
        require("neutral_cost", self.neutral_cost, above=0.0)
        require("cost_factor", self.cost_factor, at_least=0.0)
        require("lethal_cost", self.lethal_cost, above=self.neutral_cost + 1.0)
        require("fast_inflation_radius", self.fast_inflation_radius, at_least=0.0)
        require("full_speed", self.full_speed, above=0.0)


class GlobalPlanner(GlobalPath):
    """global_planner/GlobalPlanner of ROS move_base, as LiCS-KI drives it: the search of `GlobalPath` with its costs.

    A cell costs `neutral_cost` plus `cost_factor` times its cost in the costmap, but less than `lethal_cost`
    (ros-planning/navigation, global_planner/expander.h). The inflation radius grows linearly with the speed, from
    `costmap.inflation_radius` to `fast_inflation_radius` at `full_speed`.
    """

    Config = GlobalPlannerConfig

    def __init__(self, config: GlobalPlannerConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self._inflation = config
        self._r_min = robot.footprint.inscribed_radius
        self._stamps: dict[int, Ints] = {}
        costs = np.arange(256)
        paid = np.minimum(config.neutral_cost + config.cost_factor * costs, config.lethal_cost - 1.0)
        self.cell_costs = np.where(costs < HIGHEST, paid, np.inf)

    def _update_costmap(self, observation: Observation) -> Costmap:
        """Return the map with this scan; it will be inflated for the current speed."""
        costmap = super()._update_costmap(observation)
        config, slow_radius = self._inflation, self._inflation.costmap.inflation_radius
        fraction = min(max(observation.twist.v / config.full_speed, 0.0), 1.0)
        radius = round((slow_radius + fraction * (config.fast_inflation_radius - slow_radius)) / _ROUNDED)
        if radius not in self._stamps:
            inflated = replace(config.costmap, inflation_radius=radius * _ROUNDED)
            self._stamps[radius] = stamp(inflated, self._r_min)
        costmap.stamp = self._stamps[radius]
        return costmap
