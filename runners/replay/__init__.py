"""Replay of recordings: what a guide and a planner would have done where a robot has driven."""
