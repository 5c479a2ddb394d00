"""A Unitree Go2 that walks in MuJoCo, with legs, motors and a gait policy, among obstacles that it can touch."""

from lme.simulation.mujoco.simulator import MujocoSimulator

__all__ = ["MujocoSimulator"]
