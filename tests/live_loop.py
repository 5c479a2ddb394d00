"""A simulated robot behind the live driver, with the messages and the clock of a real one."""

import numpy as np

from lme.episode import Progress
from lme.geometry.frames import to_robot
from lme.live.config import LiveConfig
from lme.live.driver import LiveDriver
from lme.types import Pose
from runners.workers.episodes import episode_rng
from tests.made_bags import SECOND, BagMaker

BEGAN = 1_700_000_000 * SECOND


def sensed(observation, now, maker, mount=Pose(0.0, 0.0, 0.0)):  # noqa: B008 - immutable
    """The messages of one observation: scan, odometry, transforms."""
    scan = observation.scan
    limits = scan.range_min, scan.range_max
    return (
        maker.scan(now, scan.ranges, scan.angle_min, scan.angle_increment, limits),
        maker.odometry(now, observation.odometry, *observation.twist),
        maker.transform(now, "base_link", "laser", mount),
    )


def drive_live(task, make_navigator, robot, simulator, rng=None, listen=None, **config):
    """Drive an episode through the live driver; (driver, steps, state at the end, time on the task's clock [s])."""
    config = {"goal_tolerance": task.goal_tolerance, **config}
    driver = LiveDriver(make_navigator, robot, LiveConfig(**config), wall=lambda: 0)
    maker, now, steps = BagMaker(), BEGAN, []
    rng = episode_rng(0, task.number, 0) if rng is None else rng
    observation = simulator.reset(task, rng.spawn(2)[1])
    progress = Progress(task, simulator.state)
    driver.set_goal(to_robot(np.asarray(task.goal, dtype=float), task.start), "odom", now)
    while (outcome := progress.outcome(simulator.state)) is None:
        scan, odometry, mount = sensed(observation, now, maker, robot.lidar.mount)
        driver.take_transforms(mount, now, static=True)
        driver.take_odometry(odometry, now)
        driver.take_scan(scan, now)
        if not steps:
            driver.tick(now)  # prepares
        steps.append(driver.tick(now))
        if listen is not None:
            listen(driver, steps[-1])
        before = simulator.state
        observation = simulator.step(steps[-1].command)
        progress.moved(before, simulator.state)
        now += round(robot.dt * SECOND)
    return driver, steps, outcome, progress.time(simulator.state)
