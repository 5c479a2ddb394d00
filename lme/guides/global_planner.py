"""ROS's GlobalPlanner, with an inflation that grows with the speed, as LiCS-KI drives it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lme.errors import require
from lme.grids.obstacle_grid import HIGHEST
from lme.guides.global_path.guide import GlobalPath, GlobalPathConfig
from lme.mapping.costmap import Costmap, stamp
from lme.robots import Robot
from lme.types import Floats, Ints, Observation

_ROUNDED = 0.01  # [m] steps of the inflation radius


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
    """global_planner/GlobalPlanner of ROS move_base: the search of `GlobalPath` with its costs of cells.

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
        self.cell_costs = _cell_costs(config)

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


def _cell_costs(config: GlobalPlannerConfig) -> Floats:
    """Search cost of a cell for each cost of the costmap: (256,), inf where paths may not pass."""
    costs = np.arange(256)
    paid = np.minimum(config.neutral_cost + config.cost_factor * costs, config.lethal_cost - 1.0)
    return np.where(costs < HIGHEST, paid, np.inf)
