"""Rectangles of cells; tiles, walls and doors; random connected networks."""

import itertools

import numpy as np
import pytest

from lme.worlds.indoor.kinds import _split
from lme.worlds.indoor.layouts import JAMB, Rectangle, borders, door, network, random_size, room

BOX = Rectangle(2, 4, 6, 5)
LEFT, RIGHT, ABOVE = Rectangle(0, 0, 50, 60), Rectangle(50, 20, 100, 60), Rectangle(0, 60, 75, 100)
SQUARE = [(i, j) for i, j in itertools.combinations(range(9), 2) if j - i == 3 or (j - i == 1 and j % 3)]


def test_a_rectangle_is_moved_grown_and_transposed():
    assert BOX.size == (4, 1)
    assert BOX.enlarged(2) == (0, 2, 8, 7)
    assert BOX.shifted(-2, 1) == (0, 5, 4, 6)
    assert BOX.transposed() == (4, 2, 5, 6)


@pytest.mark.parametrize(
    ("other", "meets"),
    [((5, 4, 9, 9), True), ((6, 4, 9, 9), False), ((2, 5, 6, 6), False), ((0, 0, 9, 9), True)],
)
def test_rectangles_that_touch_do_not_meet(other, meets):
    assert BOX.meets(Rectangle(*other)) == Rectangle(*other).meets(BOX) == meets


def test_a_rectangle_holds_places_in_metres():
    assert BOX.holds(np.array([0.2, 0.22]))
    assert not BOX.holds(np.array([0.2, 0.26]))


def test_a_random_size_may_be_either_bound():
    rng = np.random.default_rng(0)
    assert {random_size(rng, (3, 5)) for _ in range(50)} == {3, 4, 5}


def test_a_room_has_its_tiles_walls_on_the_left_and_below():
    assert room(LEFT) == (3, 3, 50, 60)


def test_borders_are_the_walls_that_two_rooms_share():
    found = {border.tiles: border.wall for border in borders([LEFT, RIGHT, ABOVE], passage=10)}
    assert found == {(0, 1): (50, 23, 53, 60), (0, 2): (3, 60, 50, 63), (1, 2): (53, 60, 75, 63)}
    assert (1, 2) not in {border.tiles for border in borders([LEFT, RIGHT, ABOVE], passage=19)}


def test_doors_keep_their_jambs_and_differ():
    rng = np.random.default_rng(0)
    wall = Rectangle(50, 23, 53, 60)
    doors = [door(rng, wall, passage=18) for _ in range(200)]
    assert {cut.x0 for cut in doors} == {50}
    assert {cut.size[1] for cut in doors} == set(range(18, 23))
    assert (min(cut.y0 for cut in doors), max(cut.y1 for cut in doors)) == (23 + JAMB, 60 - JAMB)
    lying = door(rng, Rectangle(23, 50, 60, 53), passage=18)
    assert (lying.y0, lying.y1, lying.size[0] >= 18) == (50, 53, True)


def test_splitting_leaves_no_gap_and_no_overlap():
    whole = Rectangle(0, 0, 300, 390)
    tiles = _split(np.random.default_rng(1), whole)
    covered = np.zeros((390, 300), dtype=int)
    for tile in tiles:
        assert min(tile.size) >= 66
        covered[tile.y0 : tile.y1, tile.x0 : tile.x1] += 1
    assert (covered == 1).all()
    assert len(tiles) >= 6


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
