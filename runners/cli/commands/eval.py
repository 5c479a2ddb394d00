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
    from runners.cli import launch
    from runners.config.build import validate

    return launch.launch(config_name="eval", run=run, argv=argv, validate=validate, finish_sweep=finish_sweep)


def run(config: DictConfig, run_dir: Path) -> None:
    """One evaluation."""
    from runners.experiments.evaluate import evaluate

    evaluate(config, run_dir)


def finish_sweep(config: DictConfig, sweep_dir: Path, run_dirs: list[Path]) -> None:
    """One table and one chart over all runs of the sweep."""
    from runners.experiments import sweeps

    sweeps.finish(config, sweep_dir, run_dirs)
