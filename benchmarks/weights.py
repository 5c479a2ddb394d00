"""Measures what `lme train` finds, over several seeds, in many worlds that no training has seen.

    python -m benchmarks.weights DIR [--record] [--seeds 10] [--worlds 1000] [--maps env1,env2,fresh] [KEY=VALUE ...]

It judges the best proposal of each training: the starting weights may win the race, but not here. Without a race it is
the best trial. DIR keeps trainings and evaluations, so that a second call continues. KEY=VALUE: further words for
`lme train`; those about the system and the simulator are also words of the evaluations. --record also writes
benchmarks/results/weights.md.
"""

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
import yaml

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from runners.config.space import PARAMETERS
from runners.records.records import read_episodes
from runners.reports.analysis.paired import interval_of_mean
from runners.training.pictures import RACE, TRIALS

MAPS = {  # name: robot and map; the number of worlds follows
    "env1": ("robot=stage", "map=env1", "map.configurations="),
    "env2": ("robot=stage", "map=env2", "map.configurations="),
    "fresh": ("robot=jackal", "map=barn", "map.subset=fresh", "map.fresh_seed=1", "map.count="),
    "fresh_hard": ("robot=jackal", "map=barn", "map.subset=fresh_hard", "map.fresh_seed=1", "map.count="),
    "indoor": ("robot=stage", "map=indoor", "map.building_seed=1", "map.time_limit=240", "map.count="),
    "lab100": ("robot=jackal", "map=barn"),
    "env1_go2": ("+robot=go2", "map=env1", "map.configurations="),
    "indoor_go2": ("+robot=go2", "map=indoor", "map.building_seed=1", "map.time_limit=240", "map.count="),
}
DRIVEN_WITH = (
    "system",
    "guide",
    "planner",
    "sim",
    "cap.v_max",
    "cap.omega_max",
)  # keys of the words that are for training and evaluation


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "weights")
    words.add_argument("folder", type=Path, metavar="DIR")
    words.add_argument("--seeds", type=int, default=10)
    words.add_argument("--worlds", type=int, default=1000)
    words.add_argument("--maps", default="env1,env2,fresh")
    words.add_argument("words", nargs="*", metavar="KEY=VALUE")
    arguments = words.parse_intermixed_args()
    lines = report(
        arguments.folder, range(arguments.seeds), arguments.maps.split(","), arguments.worlds, arguments.words
    )
    show(lines, "weights", arguments.record)


def report(
    folder: Path, seeds: Sequence[int], maps: Sequence[str], worlds: int, words: Sequence[str]
) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Weights\n"
    yield f"`python -m benchmarks.weights {' '.join(['DIR', *sys.argv[2:]])}`, {machine()}\n"
    yield f"Success with its interval, collision and BARN metric in {worlds:,} worlds, each driven once, of the best"
    yield "proposal of each seed.\n"
    yield from table(folder, seeds, maps, worlds, words)


def table(
    folder: Path, seeds: Sequence[int], maps: Sequence[str], worlds: int, words: Sequence[str]
) -> Iterator[str]:
    """Yield the rows: the weights that ship with the system, then the best proposal of each seed."""
    yield f"| weights | winner | verdict | {' | '.join(maps)} |"
    yield f"|---|---|---|{'---|' * len(maps)}"
    drive_words = [word for word in words if re.split(r"[.=]", word)[0] in DRIVEN_WITH]
    start = [measured(folder / "start" / name, name, worlds, [], drive_words) for name in maps]
    yield f"| shipped | | | {' | '.join(start)} |"
    for seed in seeds:
        run_dir = folder / str(seed)
        winner, verdict, weights = trained(run_dir, seed, words)
        cells = [measured(run_dir / f"many_{name}", name, worlds, weights, drive_words) for name in maps]
        yield f"| seed {seed} | {winner} | {verdict} | {' | '.join(cells)} |"


def trained(run_dir: Path, seed: int, words: Sequence[str]) -> tuple[str, str, list[str]]:
    """Who won the race, the verdict, and the words that drive with the best proposal's values."""
    weights = run_dir / "weights.yaml"
    if not weights.is_file() or "held_out" not in yaml.safe_load(weights.read_text()):
        lme("train", "tracking=none", f"seed={seed}", f"hydra.run.dir={run_dir}", "resume=true", *words)
    content = yaml.safe_load(weights.read_text())
    trials = pd.read_csv(run_dir / TRIALS).set_index("trial")
    best = trials["reward"].idxmax()
    if (run_dir / RACE).is_file():
        race = pd.read_csv(run_dir / RACE)
        proposals = race[race["trial"] != "start"]
        best = int(proposals[proposals["rung"] == proposals["rung"].max()].iloc[0]["trial"])
    values = {key: float(value) for key, value in trials.loc[best].items() if "." in str(key)}
    parameters = {
        key.removeprefix(PARAMETERS): number for key, number in values.items() if key.startswith(PARAMETERS)
    }
    settings = [f"{key}={number!r}" for key, number in values.items() if not key.startswith(PARAMETERS)]
    proposal = run_dir / "proposal.yaml"
    proposal.write_text(yaml.safe_dump({"parameters": {**content["parameters"], **parameters}}))
    return str(content["trial"]), content["held_out"]["verdict"], [f"weights={proposal}", *settings]


def measured(
    run_dir: Path, name: str, worlds: int, weights: Sequence[str], drive_words: Sequence[str]
) -> str:
    """ "0.980 / 0.013 / 0.4831", of a run that is driven unless it was before. `lab100` is driven three times."""
    words = [f"{word}{worlds}" if word.endswith("=") else word for word in MAPS[name]]
    runs = 3 if name == "lab100" else 1
    if not (run_dir / "table.md").is_file():
        common = ("tracking=none", f"hydra.run.dir={run_dir}", "resume=true")
        lme("eval", *words, *drive_words, *weights, f"runs={runs}", *common)
    frame = read_episodes([run_dir])
    low, high = interval_of_mean(frame, "success")
    success, collision = ((frame["outcome"] == outcome).mean() for outcome in ("success", "collision"))
    return f"{success:.3f} ({low:.3f}–{high:.3f}) / {collision:.3f} / {frame['barn_metric'].mean():.4f}"


def lme(*words: str) -> None:
    """Run a command, quietly."""
    subprocess.run([sys.executable, "-m", "runners.cli.main", *words], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    run_main(main)
