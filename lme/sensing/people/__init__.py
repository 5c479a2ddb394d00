"""Tracks people and other movers from scans and odometry alone."""
