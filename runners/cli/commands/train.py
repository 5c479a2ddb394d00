"""Find the parameters of a system, then try them on configurations never trained on."""

from __future__ import annotations

EXAMPLES = (
    "lme train",
    "lme train robot=stage map=env1 search=gp seed=3",
    "lme train experiment=table1",
)


def main(argv: list[str]) -> int:
    """Compose the config and train; a sweep ends with one table over the held-out evaluations of all studies."""
    from runners.cli.launch import Command, launch
    from runners.experiments.sweeps import finish
    from runners.experiments.train import train, validate

    return launch(Command("train", train, validate, finish), argv)
