"""Draw a figure, of episodes driven for it or of a run's records: lme figure KIND …"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omegaconf import DictConfig

EXAMPLES = (
    "lme figure trajectories -m system=dwa,lme_dwa,lme world=250",
    "lme figure features world=250 figure.step=40",
    "lme figure video run=outputs/eval/RUN world=250",
    "lme figure +experiment=barn_trajectories",
)
_BESIDE_RUN = (
    "run",
    "world",
    "map.world",
    "formats",
    "figure",
    "experiment",
    "resume",
    "hydra",
)  # keys that say what to draw


def main(argv: list[str]) -> int:
    """Compose the config, drive what must be driven, and draw. `lme figure KIND` stands for `figure=KIND`."""
    from runners import app
    from runners.draw import validate

    words = _translated(argv)
    _check_beside_run(words)
    return app.launch(config_name="figure", run=run, argv=words, validate=validate, finish_sweep=finish_sweep)


def run(config: DictConfig, run_dir: Path) -> None:
    """One job: its episodes, and the figure where it is the only one."""
    from runners.draw import prepare

    prepare(config, run_dir)


def finish_sweep(config: DictConfig, sweep_dir: Path, run_dirs: list[Path]) -> None:
    """One figure of all jobs."""
    from runners.draw import draw

    draw(config, run_dirs, sweep_dir)


def _translated(argv: list[str]) -> list[str]:
    """The kind as an override, and `map.world` under its own name."""
    words = list(argv)
    if words and "=" not in words[0] and not words[0].startswith("-"):
        words[0] = f"figure={words[0]}"
    return [word.replace("map.world=", "world=", 1) if _key(word) == "map.world" else word for word in words]


def _check_beside_run(words: list[str]) -> None:
    """Raise InputError for a key that cannot hold where the records of a run are drawn."""
    from lme.errors import InputError

    given = {_key(word): word for word in words if "=" in word}
    if "run" not in given or given["run"].endswith("=null"):
        return
    for key, word in given.items():
        if key.partition(".")[0] not in _BESIDE_RUN and key not in _BESIDE_RUN:
            raise InputError(
                f"{word}: the episodes of run= are driven already, as its own config says; leave it away"
            )


def _key(word: str) -> str:
    return word.partition("=")[0].lstrip("+")
