"""Find the parameters of a system, then try them on configurations never trained on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

EXAMPLES = (
    "lme train",
    "lme train robot=stage map=env1 search=gp seed=3",
    "lme train +experiment=table1",
)


def main(argv: list[str]) -> int:
    """Compose the config and run."""
    from runners.cli import launch
    from runners.experiments.train import validate

    return launch.launch(
        config_name="train", run=run, argv=argv, validate=validate, finish_sweep=finish_sweep
    )


def run(config: DictConfig, run_dir: Path) -> None:
    """One study."""
    from runners.experiments.train import train

    train(config, run_dir)


def finish_sweep(config: DictConfig, sweep_dir: Path, run_dirs: list[Path]) -> None:
    """One table and one chart over the held-out evaluations of all studies."""
    from runners.experiments import sweeps

    sweeps.finish(config, sweep_dir, run_dirs)
