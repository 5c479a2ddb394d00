"""Tracker of people: registration, evidence of motion, clusters, circles, filter."""
