"""Samplers: proposals by the seed and the number of the trial, and searches that do not know each other."""

import optuna
import pytest

from lme.config.presets import load_settings
from runners.training.samplers import Tpe, per_trial, restart_of


def proposals(reward, restarts, count=24):
    """Values of the trials of a study, in which trial n with value x earns reward(n, x)."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    sampler = per_trial(Tpe(load_settings("search/tpe", startup=3)).sampler, 5, {"x": 0.5}, restarts)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    for number in range(count):
        trial = study.ask()
        study.tell(trial, reward(number, trial.suggest_float("x", 0.0, 1.0)))
    return [trial.params["x"] for trial in study.trials]


@pytest.mark.parametrize("restarts", [2, 3])
def test_a_search_knows_nothing_of_the_others(restarts):
    def of(other):
        return lambda number, x: -abs(x - 0.2) if restart_of(number, restarts) == 0 else other(x)

    low, high = (proposals(of(other), restarts) for other in (lambda x: x, lambda x: -x))
    assert low[::restarts] == high[::restarts]
    assert low[1::restarts] != high[1::restarts]


def test_one_search_knows_all_trials():
    def of(sign):
        return lambda number, x: sign * x if number % 2 else -abs(x - 0.2)

    low, high = proposals(of(1), 1), proposals(of(-1), 1)
    assert low[0] == high[0] == 0.5
    assert low[10::2] != high[10::2]
