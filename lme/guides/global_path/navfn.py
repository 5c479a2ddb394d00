"""Navfn of ROS move_base, with its own path: down the gradient of a potential."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_world
from lme.grids.obstacle_grid import Costs
from lme.guides.global_path.guide import GlobalPath, GlobalPathConfig
from lme.guides.global_path.potential import Cell, descend, potential
from lme.mapping.costmap import Costmap
from lme.robots import Robot
from lme.types import Floats, Pose

_PADDING = 3  # [cells] around the obstacles; the outermost are not passable, as at the border of Navfn's map
_HALF = 0.499  # [cells] half a cell; on a border of cells, a pose counts to the cell that Navfn means


@dataclass(slots=True)
class NavfnConfig(GlobalPathConfig):
    """Direction of the axes of the map, besides the settings of GlobalPath."""

    map_yaw: float

    def __post_init__(self) -> None:
        GlobalPathConfig.__post_init__(self)  # super() fails in a dataclass with slots
        require("map_yaw", self.map_yaw, at_least=-math.pi, at_most=math.pi)


class Navfn(GlobalPath):
    """navfn/NavfnROS as it is (ros-planning/navigation): `GlobalPath` with Navfn's own paths.

    A path goes down the gradient of the potential in steps of half a cell. Navfn gives the lower left corners of cells
    for their centres, so the whole path is shifted by half a cell against both axes of the map. There is no path from a
    forbidden cell, unless one of its four neighbours is passable, and none to a forbidden cell.
    """

    Config = NavfnConfig

    def __init__(self, config: NavfnConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self._shift = to_world(np.array([-_HALF, -_HALF]), Pose(0.0, 0.0, config.map_yaw))  # [cells]
        self._paid = np.floor(self.cell_costs)  # Navfn's costs are whole numbers

    def _corners(self, costmap: Costmap, robot: Floats, target: Floats) -> Floats | None:
        """Points (C, 2) [m] of the path; None if there is none."""
        begin, end = costmap.cell(robot), costmap.cell(target)
        window = costmap.window([begin, end])
        low = window[0].start - _PADDING, window[1].start - _PADDING
        start, goal = (begin[0] - low[0], begin[1] - low[1]), (end[0] - low[0], end[1] - low[1])
        cells = self._solution(costmap.costs[window].copy(), start, goal)
        if cells is None:
            return None
        return np.vstack([robot, costmap.points(cells[1:] + np.array(low) + self._shift), target])

    def _solve(self, costs: Costs, begin: Cell, end: Cell) -> Floats | None:
        """Path (K, 2) [cells] in the padded map, as are `begin` and `end`; None if there is none."""
        neutral = float(self._paid.min())
        paid = np.full((costs.shape[0] + 2 * _PADDING, costs.shape[1] + 2 * _PADDING), np.inf)
        paid[1:-1, 1:-1] = self._paid[0]
        paid[_PADDING:-_PADDING, _PADDING:-_PADDING] = self._paid[costs]
        path = descend(potential(paid, begin, end, neutral), begin, end, neutral)
        return path if len(path) > 0 else None

    def _points(self, line: Floats) -> Floats:
        """Points of the path, which are Navfn's."""
        return line
