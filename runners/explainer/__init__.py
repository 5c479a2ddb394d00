"""The explainer page: the trace of an episode as one HTML file that needs nothing else."""
