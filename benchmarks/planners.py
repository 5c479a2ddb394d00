"""Measures the closed-loop speed of every guide × planner pair on one core.

    python -m benchmarks.planners [--record]

All pairs run one after the other, so ratios are valid on a busy machine too. --record also writes
benchmarks/results/planners.md.
"""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.composer import CUSTOM
from lme.navigation.episode import run_episode
from runners.config import build, catalogue
from runners.config.command_line import compose_job
from runners.config.composer import Composer

ROBOT = "jackal"  # the longest scan, 720 beams
WORLDS = [1000, 1003, 1006, 1009, 1011]  # fresh worlds, one of each density and smoothing
WANTED = {("lme", "simple"): 6000, ("target", "dwa"): 2000}  # steps/s
SLOW = {
    "mppi": 100,
    "teb": 200,
}  # steps/s of planners that simulate thousands of trajectories, or optimise one
LEAST = 500

LEFT_OUT = (
    "_tuned",
    "_skid",
    "_no_latency",
    "dclp",
    "dclp_barn",
    "dclp_barn_global",
    "drl_vo",
    "drl_vo_barn",
)  # other values; weights that do not ship


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "planners", parser(__doc__, "planners").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Speed of every pair\n"
    yield f"`python -m benchmarks.planners --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"{ROBOT}, {len(WORLDS)} fresh BARN worlds, one core; a step is scan, decision, motion and collision check.\n"
    yield "| guide | planner | steps/s | decision p50 [µs] | p99 [µs] | wanted [steps/s] |"
    yield "|---|---|---:|---:|---:|---:|"
    options = catalogue.shipped().options
    with Composer("eval") as composer:
        for guide in options("guide"):
            for planner in options("planner"):
                if CUSTOM not in (guide, planner) and not planner.endswith(LEFT_OUT):
                    yield row(composer, guide, planner)


def row(composer: Composer, guide: str, planner: str) -> str:
    """The row of one pair."""
    words = [f"robot={ROBOT}", f"guide={guide}", f"planner={planner}", "map=barn", "map.subset=fresh"]
    config = compose_job(composer, words).config
    maps, navigator, simulator = build.map_set(config), build.navigator(config), build.simulator(config)
    tasks = [maps.task(number) for number in WORLDS]
    run_episode(tasks[0], navigator, simulator, np.random.default_rng(0))  # compiles
    steps, decisions, start = 0, [], time.perf_counter()
    for seed, task in enumerate(tasks):
        episode = run_episode(task, navigator, simulator, np.random.default_rng(seed))
        steps += episode.steps
        decisions.append(episode.decision_us)
    rate = steps / (time.perf_counter() - start)
    p50, p99 = np.percentile(np.concatenate(decisions), [50, 99])
    required = WANTED.get((guide, planner), SLOW.get(planner, LEAST))
    return f"| {guide} | {planner} | {rate:,.0f} | {p50:.0f} | {p99:.0f} | {required:,} |"


if __name__ == "__main__":
    run_main(main)
