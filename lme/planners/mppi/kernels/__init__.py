"""Compiled functions of MPPI: sampled trajectories, their average, and the costs that critics assign to them."""
