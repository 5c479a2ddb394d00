"""Measures `lme live` over real topics: from the tick to the command's arrival, and the highest rate that it holds.

    python -m benchmarks.live 1|2 [--record]

1 and 2 are the version of ROS, which this Python must have. A simulated Jackal drives through BARN worlds in real
time. The node has a core of its own where `taskset` is there. --record also writes benchmarks/results/live_rosN.md.
"""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.live.messages import SECOND, stamp_of
from runners.ros.run import connect
from runners.ros.transport import Delivery, Transport

PAPER_HZ = 8  # on a Jetson
RATES = (10, 20, 50, 100, 200, 400)  # [Hz]
HELD = 0.95  # share of the commands that must arrive
SECONDS = {10: 60.0}  # of measuring; 10 s at other rates
ROBOT = ("robot=jackal", "topics.command_type=TwistStamped")
WORLDS = "map.subset=all"


def main() -> None:
    """Print the report, and write it with --record."""
    arguments = parser(__doc__, "live_rosN")
    arguments.add_argument("version", type=int, choices=(1, 2))
    parsed = arguments.parse_args()
    show(report(parsed.version), f"live_ros{parsed.version}", parsed.record)


def report(version: int) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield f"# lme live in ROS {version}\n"
    yield f"`python -m benchmarks.live {version} --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield (
        "From the beginning of a control period to the arrival of its command in another process, which simulates "
        f"the Jackal and shares the machine. A rate is held if {100 * HELD:.0f} % of the commands arrive. The paper: "
        f"{PAPER_HZ} Hz on a Jetson.\n"
    )
    yield "| control rate [Hz] | commands per second | p50 [ms] | p99 [ms] | longest [ms] | held |"
    yield "|---:|---:|---:|---:|---:|---|"
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        isolate(version, folder, stack)
        ros = connect(version, "benchmark", ())
        stack.callback(ros.close)
        delays: list[float] = []

        def take(message: Any) -> None:
            delays.append((time.time_ns() - stamp_of(message.header)) / SECOND * 1000.0)

        ros.subscribe("cmd_vel", "geometry_msgs/TwistStamped", take, Delivery.ALL)
        for rate in RATES:
            delays.clear()
            seconds = measure(ros, delays, rate, folder)
            yield _row(delays, seconds, rate)


def _row(delays: list[float], seconds: float, rate: int) -> str:
    per_second = len(delays) / seconds
    p50, p99, maximum = np.percentile(delays, [50, 99, 100])
    is_held = "yes" if per_second >= HELD * rate else "no"
    return f"| {rate} | {per_second:.1f} | {p50:.2f} | {p99:.2f} | {maximum:.2f} | {is_held} |"


def measure(ros: Transport, delays: list[float], rate: int, folder: str) -> float:
    """Collect delays [ms] of the commands of a node with this control rate; returns for how long [s]."""
    name, seconds = f"ros{ros.version}", SECONDS.get(rate, 10.0)
    pinned = ["taskset", "-c", "0"] if shutil.which("taskset") else []
    node = (name, *ROBOT, f"robot.control_rate={rate}", "live.clock=received")
    robot = ("simulator", f"--{name}", *ROBOT, WORLDS, "live.pause=0")
    with start_lme_live(pinned, node, folder, "node"), start_lme_live([], robot, folder, "robot"):
        while len(delays) < 3 * rate:  # until it drives, with code that is loaded
            ros.handle(0.1)
        delays.clear()
        start = time.monotonic()
        while time.monotonic() < start + seconds:
            ros.handle(0.01)
    return seconds


@contextlib.contextmanager
def start_lme_live(
    prefix: list[str], words: tuple[str, ...], folder: str, name: str
) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """`lme live` with these words while the `with` lasts, and its run directory."""
    command = [*prefix, sys.executable, "-m", "runners.cli.main", "live", *words]
    run_dir = Path(tempfile.mkdtemp(dir=folder)) / name
    with (Path(folder) / f"{name}.log").open("a") as log:
        process = subprocess.Popen([*command, f"hydra.run.dir={run_dir}"], stdout=log, stderr=log)
    try:
        yield process, run_dir
    finally:
        process.terminate()
        process.wait(20)


def isolate(version: int, folder: str, stack: contextlib.ExitStack) -> None:
    """A separate ROS on the loopback."""
    os.environ |= {"ROS_LOG_DIR": folder, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "86"}
    if version == 2:
        return
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    os.environ |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    core = subprocess.Popen(
        ["roscore", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    stack.callback(core.wait)
    stack.callback(core.terminate)
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return


if __name__ == "__main__":
    run_main(main)
