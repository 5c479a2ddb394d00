"""Robots with bodies in MuJoCo, among obstacles that they can touch: a Go2 that walks, and a robot on four wheels."""

from lme.simulation.mujoco.simulator import MujocoSimulator

__all__ = ["MujocoSimulator"]
