"""Compiled functions of MPPI: sampled trajectories and their average, and what the critics think of them."""
