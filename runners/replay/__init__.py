"""Replay: the decisions that a guide and a planner make on what a robot recorded."""
