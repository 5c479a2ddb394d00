"""Tunes every baseline in the same way, and writes the shipped conf/planner/*_tuned.yaml, *_skid.yaml or *_gazebo.yaml.

    python -m benchmarks.tuning [PLANNER …] [--seed 0] [--variant tuned|skid|gazebo]

Each takes one `lme train experiment=tune guide=… planner=…`: 600 episodes on fresh BARN worlds, none official. `gazebo`
has 150 trials, as many as the paper, and so 4,500 episodes.
"""

import argparse
import subprocess
import sys
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from benchmarks.command import run_main
from lme.inputs.resources import resource_dir

GUIDES = {  # of the published systems
    "dwa": "target",
    "s3_fisvfh": "target",
    "vfh_plus": "target",
    "apf": "target",
    "eband": "global_path",
    "motion_tubes": "global_path",
    "mppi": "global_path",
    "teb": "global_path",
}
FIXED = {  # other values than the textbook's that the search needs: room for trajectories at Jackal's speed
    "mppi": {"prune_distance": 4.0, "costmap.size": 12.0},
}
VARIANTS = {  # of a planner's file: for which robot, and the words that choose it
    "tuned": ("Jackal", ()),
    "skid": ("Gazebo's Jackal in sim=skid", ("sim=skid", "cap.v_max=1", "cap.omega_max=1.57")),
    "gazebo": ("Jackal in sim=gazebo", ("sim=gazebo", "feedback=CLOSED_LOOP", "trials=150")),
}
DIGITS = 4  # significant digits of a shipped value
OUT = Path("outputs") / "tuning"


def main() -> None:
    """Tune the planners, and write a YAML file for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "planners", nargs="*", choices=[*GUIDES, []], metavar="PLANNER", help=", ".join(GUIDES)
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--variant", choices=VARIANTS, default="tuned")
    arguments = parser.parse_args()
    for planner in arguments.planners or GUIDES:
        print(tune(planner, arguments.variant, arguments.seed), flush=True)


def tune(planner: str, name: str, seed: int) -> Path:
    """Run or resume the search, and write the YAML file with the values found. name: of the variant."""
    pair = [f"guide={GUIDES[planner]}", f"planner={planner}"]
    pair += [f"planner.{key}={value:g}" for key, value in FIXED.get(planner, {}).items()]
    words = ["train", "experiment=tune", *pair, *VARIANTS[name][1], f"seed={seed}"]
    run_dir = OUT / f"{planner}-{name}-{seed}"
    options = [f"hydra.run.dir={run_dir}", "resume=true", "tracking=none"]
    subprocess.run([sys.executable, "-m", "runners.cli.main", *words, *options], check=True)
    result = yaml.safe_load((run_dir / "weights.yaml").read_text(encoding="utf-8"))
    path = resource_dir("conf") / "planner" / f"{planner}_{name}.yaml"
    text = variant(planner, VARIANTS[name][0], result, " ".join(["lme", *words]))
    path.write_text(text, encoding="utf-8")
    return path


def variant(planner: str, robot: str, result: dict[str, Any], command: str) -> str:
    """The text of the YAML file: the planner's file with the values found, each with the textbook value."""
    shipped_text = (resource_dir("conf") / "planner" / f"{planner}.yaml").read_text(encoding="utf-8")
    title, shipped = shipped_text.splitlines()[0].removeprefix("# "), yaml.safe_load(shipped_text)
    settings = {key.removeprefix("planner."): value for key, value in result["settings"].items()}
    values = _lines({**settings, **FIXED.get(planner, {})}, shipped)
    return f"""# {title.partition(":")[0]}, tuned for {robot} on fresh BARN worlds
# Found by {command}
# Reward {result["reward"]:.3f} on {len(result["configurations"])} worlds, trial {result["trial"]} of {result["trials"]}
defaults:
  - {planner}
  - _self_

{values}
"""


def _lines(settings: Mapping[str, float | None], shipped: Mapping[str, Any]) -> str:
    """YAML lines of dotted keys, nested at most once: those without a group first."""
    lines: list[str] = []
    groups = defaultdict[str, list[str]](list)
    for key, value in settings.items():
        group, _, name = key.rpartition(".")
        textbook = shipped[group][name] if group else shipped[name]
        line = f"{name}: {_shorten(value)}  # textbook: {_shorten(textbook)}"
        (groups[group] if group else lines).append(line)
    for group, inner in groups.items():
        lines += [f"{group}:", *(f"  {line}" for line in inner)]
    return "\n".join(lines)


def _shorten(value: float | None) -> str:
    return "null" if value is None else f"{value:.{DIGITS}g}"


if __name__ == "__main__":
    run_main(main)
