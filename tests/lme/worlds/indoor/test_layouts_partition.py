"""Tiles, the walls between their rooms, and doors."""

import numpy as np

from lme.worlds.indoor.kinds import _split
from lme.worlds.indoor.layouts import JAMB, Rectangle, borders, door, room

LEFT, RIGHT, ABOVE = Rectangle(0, 0, 50, 60), Rectangle(50, 20, 100, 60), Rectangle(0, 60, 75, 100)


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
