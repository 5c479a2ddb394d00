"""Compiled parts of the tracker: registration, evidence of motion, clusters, circles, filter."""
