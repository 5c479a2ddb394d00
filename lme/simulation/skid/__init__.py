"""Simulators of a robot that slips: its wheels slide on the floor, and its odometry drifts."""

from lme.simulation.skid.simulator import GazeboSimulator, SkidSimulator

__all__ = ["GazeboSimulator", "SkidSimulator"]
