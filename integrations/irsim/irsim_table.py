"""Compare LME, LME+ and ir-sim's own behaviours in random worlds of world.yaml.

pip install ir-sim
python irsim_table.py [WORLDS]        # 48; world k is that of irsim.make(…, seed=k)
"""

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

os.environ.setdefault("MPLBACKEND", "Agg")
try:
    import irsim
except ModuleNotFoundError as error:
    sys.exit(f"irsim_table.py needs {error.name}: pip install ir-sim")
import lme_behavior  # noqa: F401 (registers the behaviour)

WORLD = Path(__file__).with_name("world.yaml")
TIME_LIMIT = 100.0  # [s]
BEHAVIORS: dict[str, dict[str, Any]] = {
    "LME+": {"name": "lme", "system": "lme_plus"},
    "LME": {"name": "lme", "system": "lme"},
    "ir-sim `dash`": {"name": "dash"},
    "ir-sim `rvo`": {"name": "rvo", "vxmax": 1.0, "vymax": 1.0},
    "ir-sim `sfm`": {"name": "sfm"},
}


def drive(behavior: dict[str, Any], seed: int) -> tuple[str, float]:
    """How the robot fares with a behaviour in one world, and when it ends [s]."""
    content = yaml.safe_load(WORLD.read_text(encoding="utf-8"))
    content["robot"]["behavior"] = behavior
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        env = irsim.make(str(path), headless=True, seed=seed, log_level="ERROR")
    while env.time < TIME_LIMIT:
        env.step()
        if env.robot.collision:
            return "collision", env.time
        if env.robot.arrive:
            return "success", env.time
    return "timeout", env.time


def main(worlds: int) -> None:
    print(f"{worlds} worlds, ir-sim {irsim.__version__}\n")
    print("| behaviour | success | collision | time-out | median time of successes [s] | wall [s] |")
    print("|---|---:|---:|---:|---:|---:|")
    for name, behavior in BEHAVIORS.items():
        began = time.monotonic()
        ends = [drive(behavior, seed) for seed in range(worlds)]
        times = [t for outcome, t in ends if outcome == "success"]
        counts = [sum(outcome == kind for outcome, _ in ends) for kind in ("success", "collision", "timeout")]
        median = f"{np.median(times):.1f}" if times else "–"
        spent = time.monotonic() - began
        print(f"| {name} | {' | '.join(map(str, counts))} | {median} | {spent:.0f} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 48)
