"""Measures how evaluations grow: time, memory and disk from a thousand to a hundred thousand episodes.

    python -m benchmarks.scale [--sizes 1000 10000 100000] [--record]

Drives with `lme eval`, as a user would. The episodes are cheap, so that the machinery around them shows: the robot
heads for the goal in an empty room, from a hundred starts, with noise, so that no two episodes are equal. They take 70
control steps, as many as LME's in BARN, so their records are as large. Takes ten minutes on two quiet cores.
--record also writes benchmarks/results/scale.md and scale.png. Memory is read from /proc, on Linux only.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import RESULTS, parser, show
from benchmarks.speed import machine
from benchmarks.watching import RUN, Watched, watch
from runners.records.parquet import EPISODES, TRAJECTORIES
from runners.reports.figures.style import BLUE, GREEN, VERMILION, new_figure, save

SIZES = (1_000, 10_000, 100_000)
WORKERS = (1, 2, 4)
MOST = 10_000  # episodes for each number of workers
STARTS = 100
ROOM = "bounds: [0, 0, 9, 3]\nstart: [1, 1.5]\ngoal: [8, 1.5]\n"  # a scene file, 7 m to drive
CHEAP = (
    *("map=real1", "map.path=room.yaml", "map.name=room", f"map.starts={STARTS}", "sim.goal_noise=0.05"),
    *("robot=stage", "robot.lidar.num_beams=90", "guide=target", "planner=simple"),
)
BARN = ("map=barn",)  # LME in the hundred worlds
FAR = 10_000_000
WINDOWS = 20  # of a drive, in the plot


class Size(NamedTuple):
    """What was measured for a number of episodes.

    first, second: the run, killed at half, and resumed. table: `lme table`. again: the complete run, resumed.
    episodes, trajectories: bytes of the two files.
    """

    number: int
    first: Watched
    second: Watched
    table: Watched
    again: Watched
    episodes: int
    trajectories: int


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "scale")
    words.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="numbers of episodes, in hundreds")
    arguments = words.parse_args()
    show(report(arguments.sizes, arguments.record), "scale", arguments.record)


def report(numbers: Sequence[int], record: bool) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Scale\n"
    yield f"`python -m benchmarks.scale --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"`lme eval {' '.join(CHEAP)} executor.workers=2 tracking=none`\n"
    yield f"{STARTS} starts × `runs`. The episodes are cheap, so that the machinery shows: ahead through an empty room,"
    yield "with a noisy goal, in 70 control steps, as many as LME takes in BARN, so the records have the same size."
    yield "Every run is killed by SIGKILL when half of its episodes are on disk, and resumed.\n"
    yield "## Time and memory of a run\n"
    yield "Coordinator: the process that hands out the episodes and writes the records; its workers are not counted."
    yield "Start: until the first new episode. Report: tables and picture. Two figures: of the new run, of the resumed."
    yield ""
    yield "| episodes | ms per episode | start [s] | merge [s] | report [s] | coordinator, driving [MB] | peak [MB] |"
    yield "|---:|---:|---:|---:|---:|---:|---:|"
    sizes = []
    for number in numbers:
        sizes.append(measured(number))
        yield growth_row(sizes[-1])
    yield "\n## Tables, and resuming a complete run\n"
    yield "| episodes | `lme table RUN` [s] | its peak [MB] | `resume=true` [s] | its peak [MB] |"
    yield "|---:|---:|---:|---:|---:|"
    yield from map(table_row, sizes)
    yield "\n## Disk, bytes per episode\n"
    yield f"| episodes | log, until the merge | `{EPISODES}` | `{TRAJECTORIES}` |"
    yield "|---:|---:|---:|---:|"
    yield from map(disk_row, sizes)
    yield "\n## Workers\n"
    yield "| what | episodes | workers | ms per episode | coordinator driving [MB] |"
    yield "|---|---:|---:|---:|---:|"
    for number in numbers:
        if number <= MOST:
            yield from worker_rows("the room", number, CHEAP)
    yield from worker_rows("LME in BARN", numbers[0], BARN)
    if len(sizes) > 1:
        yield f"\n## {FAR:,} episodes, on paper\n"
        yield from far_rows(*sizes[-2:])
    if record:
        draw(sizes, RESULTS / "scale")
        yield "\n![Time per episode, memory, and times of whole commands](scale.png)"


def measured(number: int) -> Size:
    """Drive `number` episodes in two halves, and work on the complete run."""
    with tempfile.TemporaryDirectory() as name:
        folder = place(name)
        first = watch(command(number, 2), folder, kill_at=number // 2)
        second = watch([*command(number, 2), "resume=true"], folder)
        table = watch(["table", RUN], folder)
        table_again = watch([*command(number, 2), "resume=true"], folder)
        files = [(folder / RUN / file).stat().st_size for file in (EPISODES, TRAJECTORIES)]
    return Size(number, first, second, table, table_again, *files)


def place(name: str) -> Path:
    """A folder to call `lme` in."""
    folder = Path(name)
    (folder / "room.yaml").write_text(ROOM)
    return folder


def command(number: int, workers: int, experiment: Sequence[str] = CHEAP) -> list[str]:
    """The words of `lme` that drive so many episodes."""
    words = [f"runs={number // STARTS}", f"executor.workers={workers}", "tracking=none"]
    return ["eval", *experiment, *words, f"hydra.run.dir={RUN}"]


def growth_row(size: Size) -> str:
    """Time and memory of the two halves."""
    first, resumed = size.first, size.second
    cells = [
        f"{size.number:,}",
        f"{first.ms_per_episode:.2f}, {resumed.ms_per_episode:.2f}",
        f"{first.start_s:.1f}, {resumed.start_s:.1f}",
        f"{resumed.merge_s:.1f}",
        f"{resumed.report_s:.1f}",
        f"{first.driving_mb:.0f}, {resumed.driving_mb:.0f}",
        f"{resumed.peak_mb:.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def table_row(size: Size) -> str:
    """Time and memory of what works on a complete run."""
    cells = [f"{table.wall_s:.1f} | {table.peak_mb:.0f}" for table in (size.table, size.again)]
    return f"| {size.number:,} | {' | '.join(cells)} |"


def disk_row(size: Size) -> str:
    """Bytes per episode."""
    sizes = (size.second.log_bytes, size.episodes, size.trajectories)
    return f"| {size.number:,} | {' | '.join(f'{count / size.number:,.0f}' for count in sizes)} |"


def worker_rows(name: str, number: int, words: Sequence[str]) -> Iterator[str]:
    """A row for each number of workers."""
    for workers in WORKERS:
        with tempfile.TemporaryDirectory() as folder:
            run = watch(command(number, workers, words), place(folder))
        yield f"| {name} | {number:,} | {workers} | {run.ms_per_episode:.2f} | {run.driving_mb:.0f} |"


def far_rows(small: Size, large: Size) -> Iterator[str]:
    """What `FAR` episodes would take, by the straight line through two sizes."""

    def at_far(figure: Callable[[Size], float]) -> float:
        slope = (figure(large) - figure(small)) / (large.number - small.number)
        return figure(large) + slope * (FAR - large.number)

    drive_s = FAR * large.second.ms_per_episode / 1e3
    log, files = large.second.log_bytes, large.episodes + large.trajectories
    yield f"By the straight line through {small.number:,} and {large.number:,} episodes:\n"
    yield "| what | |"
    yield "|---|---:|"
    yield f"| driving, with two workers | {drive_s / 3600:,.0f} h |"
    yield f"| disk until the merge is done | {(log + files) / large.number * FAR / 1e9:,.0f} GB |"
    yield f"| disk of the complete run | {files / large.number * FAR / 1e9:,.0f} GB |"
    yield f"| coordinator while driving a new run | {at_far(lambda size: size.first.driving_mb) / 1e3:,.1f} GB |"
    yield f"| coordinator while driving the second half | {at_far(lambda size: size.second.driving_mb) / 1e3:,.1f} GB |"
    yield f"| coordinator at its peak | {at_far(lambda size: size.second.peak_mb) / 1e3:,.1f} GB |"
    yield f"| merge | {at_far(lambda size: size.second.merge_s) / 60:,.0f} min |"
    yield f"| `lme table` | {at_far(lambda size: size.table.wall_s) / 60:,.1f} min |"
    yield f"| `lme table`, memory | {at_far(lambda size: size.table.peak_mb) / 1e3:,.1f} GB |"


def draw(sizes: Sequence[Size], stem: Path) -> None:
    """Draw time per episode and memory over the course of the largest run, and times of commands by size."""
    figure = new_figure(10, 3.2)
    pace, memory, commands = figure.subplots(1, 3)
    largest = sizes[-1]
    for phase, colour, name in ((largest.first, BLUE, "new"), (largest.second, VERMILION, "resumed")):
        counts = np.array([sample.episodes for sample in phase.driving])
        times = np.array([sample.time_s for sample in phase.driving])
        edges = np.linspace(counts[0], counts[-1], WINDOWS + 1)
        ms = np.diff(np.interp(edges, counts, times)) / np.diff(edges) * 1e3
        pace.plot((edges[1:] + edges[:-1]) / 2, ms, "o-", color=colour, markersize=3, label=name)
        memory.plot(
            counts, [sample.rss_mb for sample in phase.driving], color=colour, label=f"{name}, driving"
        )
    pace.set(title="ms per episode", xlabel="episodes on disk", ylim=(0, None))
    numbers = [size.number for size in sizes]
    memory.plot(
        numbers, [size.second.peak_mb for size in sizes], "s--", color=GREEN, label="peak of a run of N"
    )
    memory.set(title="coordinator [MB]", xlabel="episodes", ylim=(0, 1000))
    for values, name in (
        ([size.second.merge_s for size in sizes], "merge"),
        ([size.table.wall_s for size in sizes], "lme table"),
        ([size.again.wall_s for size in sizes], "resume=true, complete"),
        ([size.second.start_s for size in sizes], "start of a resumed run"),
    ):
        commands.plot(numbers, values, "o-", markersize=3, label=name)
    commands.set(title="seconds", xlabel="episodes of the run", xscale="log", ylim=(0, None))
    for axes in (pace, memory, commands):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
        axes.legend(frameon=False, fontsize=7.5)
    save(figure, stem)


if __name__ == "__main__":
    run_main(main)
