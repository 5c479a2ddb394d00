"""Compiled functions of the timed elastic band: its samples, the obstacles near them, and the normal equations."""
