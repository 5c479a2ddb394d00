"""Decisions and drives of a planner alone, without a guide."""

import numpy as np

from lme.config.presets import load_settings
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.simulation.fast import FastSimulator
from lme.types import Guidance
from tests.builders import task


def plan(made, view):
    return made.plan(view, Guidance(view.target))


def drive(planner, robot, world=None, time_limit=60.0, **changes):
    made = Navigator(Target(TargetConfig(), robot), planner)
    place = task(world, time_limit=time_limit, **changes)
    return run_episode(place, made, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0))
