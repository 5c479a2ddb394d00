"""The explainer page: an episode told again, as one HTML file that needs nothing else."""
