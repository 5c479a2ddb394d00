"""The robot is stopped while the loop that should drive it is blocked."""

import threading
import time

from runners.ros.watchdog import Watchdog


def test_the_watchdog_halts_the_robot_repeatedly_until_it_is_fed():
    halted = threading.Semaphore(0)
    with Watchdog(0.02, halted.release):
        assert all(halted.acquire(timeout=10.0) for _ in range(3))


def test_the_watchdog_does_not_disturb_a_running_loop():
    halts = []
    with Watchdog(5.0, lambda: halts.append(1)) as watchdog:
        for _ in range(20):
            watchdog.feed()
            time.sleep(0.005)
    assert not halts
