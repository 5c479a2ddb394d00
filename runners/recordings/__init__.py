"""Replay: the decisions that a guide and a planner make on a robot's recording."""
