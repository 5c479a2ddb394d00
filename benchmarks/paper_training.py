"""Trains as the paper does, over several seeds, in both readings of the surmount feature and three sets of ranges.

    python -m benchmarks.paper_training DIR [--record] [--seeds 10] [--worlds 300]

Each study is that of `lme train experiment=train/paper`: a Gaussian process in Env1 alone, 150 trials of four drives,
no race, no known weights. Its best trial then drives Env1, Env2 and fresh BARN worlds. DIR keeps trainings and
evaluations, so that a second call continues. --record also writes benchmarks/results/paper_training.md.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from benchmarks.weights import table
from runners.records.records import read_episodes

STUDY = (
    *("robot=stage", "map=env1", "search=gp", "search.startup=3", "race=null", "restarts=1"),
    *("start_from_config=false", "runs=1", "executor=serial"),
)
A_S = "space.guide.parameters"
RANGES = {  # folder: what is searched, and the words for it
    "wide": ("a_mount and every c to 1000, a_close and a_dev to 10", ("space=lme_wide",)),
    "lme": ("every c to 1000, a_mount to 100, a_close and a_dev to 10", ("space=lme",)),
    "kind": (
        "every c to 1000, every a to 100",
        ("space=lme", f"{A_S}.a_close.high=100", f"{A_S}.a_dev.high=100"),
    ),
}
READINGS = ("every", "hidden")  # of the surmount feature
MAPS = ("env1", "env2", "fresh")


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "paper_training")
    words.add_argument("folder", type=Path, metavar="DIR")
    words.add_argument("--seeds", type=int, default=10)
    words.add_argument("--worlds", type=int, default=300)
    arguments = words.parse_args()
    show(
        report(arguments.folder, range(arguments.seeds), arguments.worlds), "paper_training", arguments.record
    )


def report(folder: Path, seeds: range, worlds: int) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# The paper's training\n"
    yield f"`python -m benchmarks.paper_training DIR --record`, {machine()}\n"
    yield f"`lme train {' '.join(STUDY)}`, seeds {seeds[0]} to {seeds[-1]};"
    yield f"{worlds} worlds of each map, each driven once.\n"
    tables = []
    for reading in READINGS:
        for name, (description, space) in RANGES.items():
            words = [*STUDY, *space, f"guide.surmount={reading}"]
            rows = list(table(folder / f"{name}-{reading}", seeds, MAPS, worlds, words))
            tables += [f"\n## {reading}, {description}\n", f"`{' '.join(words[len(STUDY) :])}`\n", *rows]
    yield "\n## Success over the seeds: median (lowest–highest)\n"
    yield f"| ranges | `guide.surmount` | {' | '.join(MAPS)} |"
    yield f"|---|---|{'---:|' * len(MAPS)}"
    for name, (description, _) in RANGES.items():
        for reading in READINGS:
            cells = [_spread(folder / f"{name}-{reading}", seeds, map_name) for map_name in MAPS]
            yield f"| {description} | {reading} | {' | '.join(cells)} |"
    yield "\nIn the tables: success with its interval, collision and BARN metric."
    yield from tables


def _spread(folder: Path, seeds: range, map_name: str) -> str:
    frames = [read_episodes([folder / str(seed) / f"many_{map_name}"]) for seed in seeds]
    success = [(frame["outcome"] == "success").mean() for frame in frames]
    return f"{np.median(success):.3f} ({min(success):.3f}–{max(success):.3f})"


if __name__ == "__main__":
    run_main(main)
