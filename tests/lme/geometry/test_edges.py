"""A ray meets an edge between its ends, also where rounding decides on which side of the ray they lie."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.edges import ray_to_edge

ANGLES = st.floats(-math.pi, math.pi)
DISTANCES = st.floats(0.0, 30.0)


def test_a_wall_across_the_ray():
    assert ray_to_edge(2.0, -1.0, 2.0, 1.0, 1.0, 0.0) == 2.0
    assert ray_to_edge(-2.0, -1.0, -2.0, 1.0, 1.0, 0.0) == math.inf
    assert ray_to_edge(2.0, 1.0, 2.0, 3.0, 1.0, 0.0) == math.inf


@given(ANGLES, DISTANCES, DISTANCES)
def test_an_edge_along_the_ray_is_met_between_its_ends_or_not_at_all(angle, start, end):
    dx, dy = math.cos(angle), math.sin(angle)
    distance = ray_to_edge(start * dx, start * dy, end * dx, end * dy, dx, dy)
    assert distance == math.inf or distance == pytest.approx(
        min(max(distance, min(start, end)), max(start, end)), abs=1e-12
    )


@given(ANGLES, st.floats(1e-3, 30.0), st.floats(1e-3, 30.0))
def test_an_edge_along_the_ray_behind_it_is_not_met(angle, start, end):
    dx, dy = math.cos(angle), math.sin(angle)
    assert ray_to_edge(-start * dx, -start * dy, -end * dx, -end * dy, dx, dy) == math.inf
