"""A simulated robot behind the live driver, with the messages and the clock of a real one."""

from collections import Counter
from dataclasses import replace
from operator import itemgetter

import numpy as np

from lme.geometry.frames import to_robot
from lme.live.config import LiveConfig
from lme.live.driver import LiveDriver
from lme.navigation.episode import Progress
from lme.types import Pose, Twist
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


def drive_live(task, make_navigator, robot, simulator, rng=None, listen=None, expected=None, **config):
    """Drive an episode through the live driver; (driver, steps, outcome, time on the task's clock [s]).

    expected: the robot of the driver's config, if not the simulated one. listen(driver, step) is called at each step.
    """
    config = {"goal_tolerance": task.goal_tolerance, **config}
    driver = LiveDriver(make_navigator, expected or robot, LiveConfig(**config), wall=lambda: 0)
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


def drive_over_network(
    task, make_navigator, robot, simulator_of, seed, delay=0.05, lost=0.1, scan_rate=10.0, **config
):
    """The same where messages and ticks come at their own times: delayed, overtaken by others, or lost.

    simulator_of: makes the simulator of a robot; it steps at 50 Hz and sends odometry as often. delay: of a message at
    most [s]. lost: share of them. Commands are executed when they come. Returns the outcome, and how often each
    reason was given.
    """
    config = {"goal_tolerance": task.goal_tolerance, **config}
    driver = LiveDriver(make_navigator, robot, LiveConfig(**config), wall=lambda: 0)
    rng, maker, under_way, reasons = np.random.default_rng(seed), BagMaker(), [], Counter()
    fine = replace(robot, control_rate=50.0)
    simulator = simulator_of(fine)
    observation = simulator.reset(task, rng)
    progress, command, now = Progress(task, simulator.state), Twist(0.0, 0.0), BEGAN
    due_scan, due_tick = now + rng.uniform(0.0, SECOND / scan_rate), now + rng.uniform(0.0, robot.dt * SECOND)
    driver.take_transforms(maker.transform(now, "base_link", "laser", robot.lidar.mount), now, static=True)
    driver.set_goal(to_robot(np.asarray(task.goal, dtype=float), task.start), "odom", now)
    while (outcome := progress.outcome(simulator.state)) is None:
        scan, odometry, _ = sensed(observation, now, maker)
        sent = [(driver.take_odometry, odometry)]
        if now >= due_scan:
            due_scan += SECOND / scan_rate
            sent.append((driver.take_scan, scan))
        for take, message in sent:
            if rng.uniform() >= lost:
                under_way.append((now + rng.uniform(0.0, delay * SECOND), take, message))
        for _, take, message in sorted((one for one in under_way if one[0] <= now), key=itemgetter(0)):
            take(message, now)
        under_way = [one for one in under_way if one[0] > now]
        if now >= due_tick:
            due_tick += robot.dt * SECOND
            step = driver.tick(now)
            command = step.command
            reasons[step.reason.partition(" is ")[0]] += 1
        before = simulator.state
        observation = simulator.step(command)
        progress.moved(before, simulator.state)
        now += SECOND // 50
    return outcome, reasons
