"""Measures how much the BARN result changes with each value that the paper does not give.

    python -m benchmarks.assumptions [--baselines] [--out FOLDER]

Changes one value at a time: LME on lab100, three seeds of three runs, 900 episodes. With --baselines, halves and
doubles every number that a baseline's YAML marks ASSUMED, on 200 fresh worlds. Prints a table of
research/assumptions.md. Skips results that are already in FOLDER. About a minute and a half per row on two cores.
"""

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
import yaml

from benchmarks.command import run_main
from runners.config import catalogue

CHANGES = (
    "",
    "guide.surmount=hidden",
    "guide.candidates.number=100",
    "guide.candidates.number=1000",
    "guide.candidates.max_range=3",
    "guide.candidates.max_range=8",
    "guide.candidates.distribution=area",
    "guide.candidates.target=false",
    "guide.blocking=line_of_sight",
    "guide.history_min_distance=0",
    "guide.history_min_distance=1.5",
    "planner.pd_below=0.1",
    "planner.pd_below=0.4",
    "planner.kp=2",
    "planner.kp=8",
    "planner.kd=0",
    "planner.kd=0.3",
    "robot.control_rate=5",
    "robot.control_rate=20",
    "sim.even_ramp=true",
    "sim.max_step=0.0125",
    "robot.alpha_v=5 robot.alpha_omega=20",
    "robot.alpha_v=3 robot.alpha_omega=15",
    "planner.alpha_v=3",
    "planner.alpha_v=5",
    "planner.alpha_v=5 planner.alpha_omega=20",
    "robot.lidar.range_max=10",
    "robot.lidar.noise_std=0",
    "robot.collision_radius=0.3",
    "robot.footprint.length=0.458 robot.footprint.width=0.416",
)
SEEDS = (0, 1, 2)
BASELINES = {  # the file whose values are changed, and the overrides of its run
    "planner/dwa": "guide=target planner=dwa",
    "planner/s3_fisvfh": "guide=target planner=s3_fisvfh",
    "planner/vfh_plus": "guide=target planner=vfh_plus",
    "planner/apf": "guide=target planner=apf",
    "planner/eband": "guide=global_path planner=eband",
    "planner/motion_tubes": "guide=global_path planner=motion_tubes",
    "guide/global_path": "guide=global_path",
    "guide/tangent_bug": "guide=tangent_bug",
}
FRESH = "map.subset=fresh map.count=200 runs=1"
FACTORS = (0.5, 2.0)
REFUSED = 2  # exit code of an invalid value
OUTCOMES = ("success", "collision", "timeout")


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--baselines", action="store_true", help="change values of the baselines instead of LME"
    )
    parser.add_argument("--out", type=Path, default=Path("outputs/assumptions"))
    arguments = parser.parse_args()
    print("| changed | success | collision | timeout | BARN metric | success moves by |")
    print("|---|---:|---:|---:|---:|---:|")
    if not arguments.baselines:
        table("", CHANGES, SEEDS, arguments.out)
    for name, words in BASELINES.items() if arguments.baselines else ():
        table(f"{words} {FRESH}", ["", *changes(name)], SEEDS[:1], arguments.out)


def table(words: str, change_words: Sequence[str], seeds: Sequence[int], out: Path) -> None:
    """Print the lines of the table for these overrides, alone and with each change."""
    base = None
    for change in change_words:
        frame = episodes(f"{words} {change}".strip(), seeds, out)
        if frame is None:
            print(f"| `{change}` | not allowed | | | | |", flush=True)
            continue
        rates = [float((frame["outcome"] == outcome).mean()) for outcome in OUTCOMES]
        base = rates[0] if base is None else base
        name = (
            f"`{change}`"
            if change
            else f"nothing: `{words.removesuffix(FRESH).strip()}`"
            if words
            else "nothing"
        )
        cells = [name, *(f"{rate:.3f}" for rate in rates), f"{frame['barn_metric'].mean():.3f}"]
        print(f"| {' | '.join(cells)} | {rates[0] - base:+.3f} |", flush=True)


def changes(name: str) -> Iterator[str]:
    """Overrides that halve and double every assumed number of a YAML file."""
    group = name.partition("/")[0]
    for key in catalogue.shipped().keys(name):
        value = yaml.safe_load(key.value)
        if "ASSUMED" in key.comment and isinstance(value, int | float):
            for factor in FACTORS:
                yield f"{group}.{key.name}={type(value)(value * factor)}"


def episodes(change: str, seeds: Sequence[int], out: Path) -> pd.DataFrame | None:
    """Records of one change, from disk if they are complete; None if the value is not allowed."""
    frames = []
    for seed in seeds:
        folder = out / (re.sub(r"[ =]", "_", change) or "nothing") / str(seed)
        if not (folder / "table.md").exists():
            words = [
                "eval",
                "map=barn",
                "tracking=none",
                f"seed={seed}",
                f"hydra.run.dir={folder}",
                *change.split(),
            ]
            resume = ["resume=true"] if folder.exists() else []
            command = [str(Path(sys.executable).parent / "lme"), *words, *resume]
            process = subprocess.run(command, check=False, capture_output=True, text=True)
            if process.returncode == REFUSED:
                return None
            process.check_returncode()
        frames.append(pd.read_parquet(folder / "episodes.parquet"))
    return pd.concat(frames)


if __name__ == "__main__":
    run_main(main)
