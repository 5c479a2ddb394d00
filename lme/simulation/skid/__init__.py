"""Simulator of a robot that slips: wheels that slide on the floor, and odometry that drifts."""

from lme.simulation.skid.simulator import SkidSimulator

__all__ = ["SkidSimulator"]
