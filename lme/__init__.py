"""Local-Minimum Escaper: programmatic subgoals for mapless navigation, and what it takes to measure them."""

__version__ = "0.1.0"
