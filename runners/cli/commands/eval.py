"""Drive a map set with one system and tabulate how it went."""

from __future__ import annotations

EXAMPLES = (
    "lme eval map=barn",
    "lme eval -m ablation=none,no_c_o map.subset=official50",
)


def main(argv: list[str]) -> int:
    """Compose the config and evaluate; a sweep ends with one table and one chart over all its runs."""
    from runners.cli.launch import Command, launch
    from runners.evaluate.evaluate import evaluate, finish_sweep, validate

    return launch(Command("eval", evaluate, validate, finish_sweep), argv)
