"""Drives a Go2 that walks in MuJoCo over real topics, as a real one would be driven, and counts its arrivals.

    python -m benchmarks.live_walking 1|2 [--starts 10] [--record]

1 and 2 are the version of ROS, which this Python must have, with lme and MuJoCo. `lme live` runs LME+ in a process of
its own and gets what FAST-LIO and the drivers of a Go2 publish: clouds and odometry with tilt and a twist of zero at
10 Hz, and an IMU. It takes ten minutes, in real time. --record also writes benchmarks/results/live_walking_rosN.md.
"""

import contextlib
import csv
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Iterator

from benchmarks.command import run_main
from benchmarks.live import isolate, start_lme_live
from benchmarks.recording import parser, show
from benchmarks.speed import machine

SCENES = ("go2_a", "go2_b")
CLOUDS = {  # what it is, the topics of both sides, and how the simulator takes the cloud
    "FAST-LIO's registered cloud": (("topics=go2",), "sim.registered=true"),
    "the lidar's raw cloud": (("topics=go2", "topics.scan=livox/lidar"), "sim.registered=false"),
}
NODE = ("robot=go2", "system=lme_plus", "live.use_sim_time=true")
ROBOT = ("robot=go2", "sim=mujoco", "sim.twist=zero", "live.scan_rate=10", "live.odometry_rate=10", "runs=1")
PATIENCE = 150.0  # [s] of real time for a start, at most


def main() -> None:
    """Print the report, and write it with --record."""
    arguments = parser(__doc__, "live_walking_rosN")
    arguments.add_argument("version", type=int, choices=(1, 2))
    arguments.add_argument("--starts", type=int, default=10, help="of each scene")
    parsed = arguments.parse_args()
    show(report(parsed.version, parsed.starts), f"live_walking_ros{parsed.version}", parsed.record)


def report(version: int, starts: int) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    command = f"python -m benchmarks.live_walking {version} --starts {starts} --record"
    yield f"# A walking Go2 over ROS {version}\n"
    yield f"`{command}`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield (
        "LME+ in `lme live` drives the Go2 of `sim=mujoco` over real topics, in real time, with a twist that is always "
        "zero. Clouds and odometry come at 10 Hz, and the IMU at 50 Hz.\n"
    )
    yield "| cloud | scene | success | median time [s] | other outcomes |"
    yield "|---|---|---:|---:|---|"
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        isolate(version, folder, stack)
        for cloud, (topics, taken) in CLOUDS.items():
            for scene in SCENES:
                rows = drive(version, topics, (taken, f"map={scene}"), starts, folder)
                yield _row(cloud, scene, rows)


def drive(
    version: int, topics: tuple[str, ...], place: tuple[str, ...], starts: int, folder: str
) -> list[dict[str, str]]:
    """Drive from the first starts of a scene; return the rows of the simulator's table."""
    worlds = f"map.worlds={list(range(starts))}".replace(" ", "")
    robot = ("simulator", f"--ros{version}", *ROBOT, *topics, *place, worlds)
    with (
        start_lme_live([], (f"ros{version}", *NODE, *topics), folder, "node"),
        start_lme_live([], robot, folder, "robot") as (process, run_dir),
    ):
        process.wait(PATIENCE * starts)
        with (run_dir / "outcomes.csv").open(encoding="utf-8") as table:
            return list(csv.DictReader(table))


def _row(cloud: str, scene: str, rows: list[dict[str, str]]) -> str:
    times = [float(row["time_s"]) for row in rows if row["outcome"] == "success"]
    others = Counter(row["outcome"] for row in rows if row["outcome"] != "success")
    failures = ", ".join(f"{number} {outcome}" for outcome, number in others.items()) or "none"
    median = f"{statistics.median(times):.1f}" if times else "–"
    return f"| {cloud} | {scene} | {len(times)} of {len(rows)} | {median} | {failures} |"


if __name__ == "__main__":
    run_main(main)
