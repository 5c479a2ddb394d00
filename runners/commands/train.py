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
    from runners import app
    from runners.train import validate

    return app.launch(config_name="train", run=run, argv=argv, validate=validate, finish_sweep=finish_sweep)


def run(config: DictConfig, run_dir: Path) -> None:
    """One study."""
    from runners.train import train

    train(config, run_dir)


def finish_sweep(sweep_dir: Path, run_dirs: list[Path]) -> None:
    """One table over the held-out evaluations of all studies."""
    from runners.records import find_runs, read_episodes
    from runners.tables import print_table, write_tables

    frame = read_episodes(find_runs(run_dirs))
    write_tables(frame, sweep_dir)
    print_table(frame)
    print(f"The sweep's table: {sweep_dir}")
