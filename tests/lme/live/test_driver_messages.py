"""The live driver and messages of any kind, at any time and from several threads."""

import math
import random
import threading
import time
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from lme.live.step import LiveState
from lme.types import Pose
from tests.live_loop import BEGAN
from tests.lme.live.rig import Rig, drives, stands
from tests.made_bags import SECOND


def test_garbage_is_as_if_nothing_came(rig):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.odometry()
        rig.driver.take_scan(SimpleNamespace(data=b"?"), rig.now)
        rig.driver.take_odometry(SimpleNamespace(pose=7), rig.now)
        rig.driver.take_transforms(SimpleNamespace(transforms=[None]), rig.now)
        step = rig.tick()
    assert stands(step, "the scan is older than 0.5 s (AttributeError")
    assert drives(rig.period())


@pytest.mark.parametrize("seed", range(5))
def test_no_message_makes_the_driver_raise_or_drive_blindly(seed):
    """Random messages, times and goals: a step always comes, and motion needs a scan and a pose of the last 0.5 s."""
    rig, random_ = Rig(), random.Random(seed)
    scans, poses, drove = [], [], 0
    odd = (0.0, 1.0, -1.0, math.nan, math.inf, 1e30)
    for _ in range(1000):
        rig.pass_time(random_.choice((0.0, 0.05, 0.2, 0.2, 0.3)))
        if random_.random() < 0.02:
            rig.now += random_.choice((-3, 3)) * SECOND
        stamp = rig.now + random_.choice((0, 0, 0, -SECOND // 10, SECOND, -2 * SECOND))
        match random_.randrange(6):
            case 0 | 1:
                beams = random_.choice((0, 1, 540))
                rig.scan(stamp, np.array([random_.choice((*odd, 3.0, 5.0)) for _ in range(beams)]))
                scans.append(stamp)
            case 2 | 3:
                x, y, v = random_.choices((0.0, 0.1, 0.2, 0.3, *odd), k=3)
                rig.odometry(stamp, Pose(x, y, random_.choice((0.0, 3.0, math.nan))), v)
                poses.append(stamp)
            case 4:
                rig.driver.set_goal((5.0, 1.0), random_.choice(("odom", "", "base_link", "map")), rig.now)
            case 5:
                pair = random_.sample(("map", "odom", "base_link", "laser"), 2)
                rig.transform(*pair, static=random_.random() < 0.5)
        step = rig.tick()
        assert all(map(math.isfinite, step.command))
        assert abs(step.command.v) <= rig.robot.v_max
        if step.command != (0.0, 0.0) and step.stamp == rig.now:
            drove += 1
            assert any(abs(rig.now - stamp) <= SECOND // 2 for stamp in scans)
            assert any(abs(rig.now - stamp) <= SECOND // 2 for stamp in poses)
    assert drove > 10


def test_messages_goals_and_ticks_may_come_from_several_threads():
    rig, states, began = Rig(), Counter(), time.monotonic_ns()
    driver, make = rig.driver, rig.make

    def clock():
        return BEGAN + time.monotonic_ns() - began

    def repeat(send):
        for _ in range(100):
            now = clock()
            send(now)
            time.sleep(0.002)

    ranges = np.full(540, 3.0)
    senders = [
        lambda now: driver.take_scan(make.scan(now, ranges, -math.pi, math.tau / 540, (0.02, 15.0)), now),
        lambda now: driver.take_odometry(make.odometry(now, Pose(0.0, 0.0, 0.0), 0.0, 0.0), now),
        lambda now: driver.take_transforms(make.transform(now, "map", "odom", Pose(0.0, 0.0, 0.0)), now),
        lambda now: driver.set_goal((8.0, now % 2), "map", now),
        lambda now: driver.cancel() if now % 7 == 0 else None,
    ]
    threads = [threading.Thread(target=repeat, args=(send,)) for send in senders]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        states[driver.tick(clock()).state] += 1
    for thread in threads:
        thread.join()
    assert states[LiveState.DRIVING] > 10
    assert "Error" not in driver.tick(clock()).reason
