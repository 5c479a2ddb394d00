"""Figures, films and terminal pictures: pure functions of records or of traces of episodes."""
