"""Find the parameters of a system, and say on worlds never trained on whether they are better than the start."""

from __future__ import annotations

EXAMPLES = (
    "lme train",
    "lme train +robot=go2",
    "lme train map=file map.path=hall.yaml",
    "lme train training.indoor=null race=null seed=3",
    "lme train experiment=table1",
)


def main(argv: list[str]) -> int:
    """Compose the config and train; a sweep ends with one table over the held-out evaluations of all studies."""
    from runners.cli.launch import Command, launch
    from runners.evaluate.evaluate import finish_sweep
    from runners.training.train import train, validate

    return launch(Command("train", train, validate, finish_sweep), argv)
