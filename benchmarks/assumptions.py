"""How far the BARN result moves with each value that the paper leaves open.

    python -m benchmarks.assumptions [--out FOLDER]

Each value is changed alone: hard100, three seeds of three runs, 900 episodes. Prints the table of
docs/assumptions.md. What is in FOLDER already is not run again. About half a minute a row on two cores.
"""

import argparse
import math
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd

CHANGES = (
    "",
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
    "robot.lidar.range_max=10",
    "robot.lidar.noise_std=0",
    "robot.collision_radius=0.3",
    "robot=jackal_wheels",
)
SEEDS = (0, 1, 2)
OUTCOMES = ("success", "collision", "timeout")


def main() -> None:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("outputs/assumptions"))
    out = parser.parse_args().out
    print("| changed | success | collision | timeout | BARN metric | success moves by |")
    print("|---|---:|---:|---:|---:|---:|")
    base = None
    for change in CHANGES:
        frame = episodes(change, out)
        rates = [float((frame["outcome"] == outcome).mean()) for outcome in OUTCOMES]
        base = rates[0] if base is None else base
        name = f"`{change}`" if change else "nothing"
        cells = [name, *(f"{rate:.3f}" for rate in rates), f"{frame['barn_metric'].mean():.3f}"]
        print(f"| {' | '.join(cells)} | {rates[0] - base:+.3f} |", flush=True)
    error = math.sqrt(base * (1 - base) / len(frame))
    print(f"\nStandard error of a success rate: {error:.3f}.")


def episodes(change: str, out: Path) -> pd.DataFrame:
    """Records of one change, from disk where they are complete."""
    frames = []
    for seed in SEEDS:
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
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        frames.append(pd.read_parquet(folder / "episodes.parquet"))
    return pd.concat(frames)


if __name__ == "__main__":
    main()
