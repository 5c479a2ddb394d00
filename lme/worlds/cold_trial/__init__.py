"""The cold trial: every episode has another robot, another world and other disturbances."""

from lme.worlds.cold_trial.map_set import ColdTrial, ColdTrialConfig

__all__ = ["ColdTrial", "ColdTrialConfig"]
