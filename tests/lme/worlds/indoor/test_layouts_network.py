"""Random connected networks."""

import itertools

import numpy as np
import pytest

from lme.worlds.indoor.layouts import network

SQUARE = [(i, j) for i, j in itertools.combinations(range(9), 2) if j - i == 3 or (j - i == 1 and j % 3)]


def chosen(seed=0, size=9, loops=0.0, pairs=SQUARE):
    return [pairs[i] for i in network(np.random.default_rng(seed), pairs, size, loops)]


def joined(pairs):
    """The nodes that can be reached from a node of the first pair."""
    reached = set(pairs[0])
    for _ in pairs:
        reached.update(*(pair for pair in pairs if reached.intersection(pair)))
    return reached


@pytest.mark.parametrize("size", [2, 5, 9])
def test_without_loops_a_network_is_a_tree_of_its_size(size):
    for seed in range(20):
        tree = chosen(seed, size)
        assert len(tree) == size - 1
        assert len(joined(tree)) == size == len(set(itertools.chain(*tree)))


def test_with_all_loops_a_network_is_every_pair_of_joined_nodes():
    assert chosen(loops=1.0) == SQUARE
    some = chosen(size=5, loops=1.0)
    assert some == [pair for pair in SQUARE if set(pair) <= set(itertools.chain(*some))]


def test_nodes_that_cannot_be_joined_stay_out_of_the_network():
    assert chosen(pairs=[(0, 1), (1, 2)], size=9) == [(0, 1), (1, 2)]
