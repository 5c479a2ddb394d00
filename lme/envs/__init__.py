"""Environments for reinforcement learning: one robot, or many that one compiled call moves."""
