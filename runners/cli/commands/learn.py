"""Train the network of a planner or a guide, then try it on worlds never trained on."""

from __future__ import annotations

EXAMPLES = (
    "lme learn planner=dclp learner=clone",
    "lme learn learner=clone learner.expert.planner=s3_fisvfh_tuned guides={target:0.6,lme:0.4}",
    "lme learn learner=ppo start=outputs/learn/RUN",
    "lme learn guide=learned_subgoal planner=simple learner=ppo",
    "lme eval guide=target planner=dclp planner.weights=outputs/learn/RUN",
)


def main(argv: list[str]) -> int:
    """Compose the config and learn; a sweep ends with one table over the held-out evaluations of all networks."""
    from runners.cli.launch import Command, launch
    from runners.evaluate.evaluate import finish_sweep
    from runners.learning.learn import learn, validate

    return launch(Command("learn", learn, validate, finish_sweep), argv)
