"""Use your own planner with LME in a BARN world.

In this folder, `lme eval planner._target_=own_planner.MyPlanner` runs it in a hundred worlds.
"""

from dataclasses import dataclass

import numpy as np

import lme


@dataclass
class MyConfig:
    speed: float = 0.5  # [m/s]


class MyPlanner:
    """Drives forward while the subgoal is ahead, and turns towards it."""

    Config = MyConfig

    def __init__(self, config: MyConfig, robot: lme.Robot) -> None:
        self.speed = config.speed

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode. This planner has no state."""

    def plan(self, observation: lme.Observation, guidance: lme.Guidance) -> lme.Twist:
        x, y = guidance.subgoal  # [m] in the robot frame
        return lme.Twist(self.speed * (x > abs(y)), 2.0 * np.arctan2(y, x))


def main() -> None:
    robot = lme.load_robot("jackal")
    guide = lme.Lme(lme.load_settings("guide/lme", parameters=lme.load_parameters("published")), robot)
    simulator = lme.FastSimulator(lme.load_settings("sim/fast"), robot)
    task = lme.Barn(lme.load_settings("map/barn", worlds=[200])).task(200)
    navigator = lme.Navigator(guide, MyPlanner(MyConfig(speed=0.8), robot), dt=robot.dt)
    episode = lme.run_episode(task, navigator, simulator, np.random.default_rng(0))
    print(f"{episode.outcome} after {episode.time:.1f} s and {episode.path_length:.1f} m")


if __name__ == "__main__":
    main()
