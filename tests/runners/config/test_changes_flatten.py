"""Dotted keys of nested configs."""

from runners.config.changes import flatten


def test_flatten():
    nested = {"a": {"b": {"c": 1}, "d": [2, 3]}, "e": None}
    assert dict(flatten(nested)) == {"a.b.c": 1, "a.d": [2, 3], "e": None}
