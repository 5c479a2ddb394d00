"""Drive a map set with one system and tabulate how it went."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

EXAMPLES = (
    "lme eval map=barn",
    "lme eval -m ablation=none,no_c_o map.subset=official50",
)


def main(argv: list[str]) -> int:
    """Compose the config and run."""
    from runners import app
    from runners.build import validate

    return app.launch(config_name="eval", run=run, argv=argv, validate=validate, finish_sweep=finish_sweep)


def run(config: DictConfig, run_dir: Path) -> None:
    """One evaluation."""
    from runners.evaluate import evaluate

    evaluate(config, run_dir)


def finish_sweep(sweep_dir: Path, run_dirs: list[Path]) -> None:
    """One table over all runs of the sweep."""
    from runners.records import read_episodes
    from runners.tables import print_table, write_tables

    frame = read_episodes(run_dirs)
    write_tables(frame, sweep_dir)
    print_table(frame)
    print(f"The sweep's table: {sweep_dir}")
