"""ROS's GlobalPlanner, with an inflation that grows with the speed, as LiCS-KI drives it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lme.errors import require
from lme.grids.obstacle_grid import HIGHEST
from lme.guides.global_path.guide import GlobalPath, GlobalPathConfig
from lme.mapping.costmap import Costmap, CostmapConfig, stamp
from lme.robots import Robot
from lme.types import Floats, Ints, Observation

_ROUNDED = 0.01  # [m] steps of the inflation radius


def _costmap() -> CostmapConfig:
    return CostmapConfig(
        obstacle_range=4.5,
        raytrace_range=5.0,
        observation_persistence=0.0,
        inf_is_valid=False,
        footprint_clearing=True,
    )


@dataclass(slots=True)
class GlobalPlannerConfig(GlobalPathConfig):
    """Costs of GlobalPlanner, and the inflation at full speed, besides the settings of GlobalPath."""

    costmap: CostmapConfig = field(default_factory=_costmap)
    replan_rate: float = 20.0  # [Hz]
    neutral_cost: float = 50.0
    cost_factor: float = 3.0
    lethal_cost: float = 253.0  # a cell costs less than this
    fast_inflation_radius: float = 1.0  # [m] at full_speed; costmap.inflation_radius at rest
    full_speed: float = 1.5  # [m/s]

    def __post_init__(self) -> None:
        GlobalPathConfig.__post_init__(self)  # super() fails in a dataclass with slots
        require("guide.neutral_cost", self.neutral_cost, above=0.0)
        require("guide.cost_factor", self.cost_factor, at_least=0.0)
        require("guide.lethal_cost", self.lethal_cost, above=self.neutral_cost + 1.0)
        require("guide.fast_inflation_radius", self.fast_inflation_radius, at_least=0.0)
        require("guide.full_speed", self.full_speed, above=0.0)


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
        self._r_min = robot.footprint.r_min
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
