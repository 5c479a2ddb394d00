"""The explainer page: the trace of an episode as one self-contained HTML file."""
