"""Let a guide and a planner decide on what a robot saw, and compare with what it did."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

EXAMPLES = (
    "lme replay bag=drive.mcap",
    "lme replay bag=drive.bag list=true",
    "lme replay bag=drive.bag robot=go2 guide=lme planner=dwa goal=[6.0,-1.5]",
)


def main(argv: list[str]) -> int:
    """Compose the config and run; with list=true, print the recording's topics and nothing else."""
    given = dict(word.partition("=")[::2] for word in argv)
    if given.get("list", "false").lower() in ("true", "1", "yes", "on"):
        return _list(given.get("bag", ""))
    from runners.cli import launch
    from runners.replay.run import validate

    return launch.launch(config_name="replay", run=run, argv=argv, validate=validate)


def run(config: DictConfig, run_dir: Path) -> None:
    """One replay."""
    from runners.replay.run import replay

    replay(config, run_dir)


def _list(path: str) -> int:
    from lme.errors import InputError
    from runners.replay.bags import Bag
    from runners.replay.topics import table

    if not path.strip("'\""):
        raise InputError("bag is null: give the recording, e.g. lme replay bag=drive.mcap list=true")
    with Bag(Path(path.strip("'\""))) as bag:
        print(f"{bag.path}: {bag.duration_s:.1f} s")
        print("\n".join(table(bag)))
    return 0
