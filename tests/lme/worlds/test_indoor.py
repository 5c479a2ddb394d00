"""What all generated buildings promise, and what each kind is."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from lme.worlds.indoor.layouts import CELL_M, WALL
from lme.worlds.indoor.map_set import KINDS
from lme.worlds.lattice import clearance_field

SEEDS = range(6)
NARROW, WIDE = 16, 22  # least widths of ways, 0.8 and 1.1 m
FURNISHED = ("offices", "floor_plan")


@functools.cache
def building(kind, seed, passage=NARROW):
    return KINDS[kind](np.random.default_rng(seed), passage)


def middles(kind, seed, passage=NARROW):
    """x and y of the middles of all cells [m]."""
    return ((np.arange(count) + 0.5) * CELL_M for count in building(kind, seed, passage).size)


@functools.cache
def clearance(kind, seed, passage=NARROW):
    """(rows, columns) clearance of the middle of each cell [m], at most that of a disc which passes any way."""
    plan = building(kind, seed, passage).floor_plan()
    return clearance_field(plan, *middles(kind, seed, passage), passage * CELL_M / 2)


every = pytest.mark.parametrize("kind", KINDS)
furnished = pytest.mark.parametrize("kind", FURNISHED)


@every
@pytest.mark.parametrize("passage", [NARROW, WIDE])
def test_a_disc_can_go_from_every_room_to_every_other(kind, passage):
    radius = passage * CELL_M / 2 - 0.1  # every way is at least 0.2 m wider
    for seed in SEEDS:
        regions, _ = ndimage.label(clearance(kind, seed, passage) >= radius)
        rooms = [
            set(np.unique(regions[r.y0 : r.y1, r.x0 : r.x1])) - {0}
            for r in building(kind, seed, passage).rooms
        ]
        assert set.intersection(*rooms), seed


@every
def test_walls_are_closed_and_thick(kind):
    for seed in SEEDS:
        plan = replace(building(kind, seed), furniture=[]).floor_plan()
        x, y = middles(kind, seed)
        solid = clearance_field(plan, x, y, CELL_M) == 0.0
        border = np.ones_like(solid)
        border[WALL:-WALL, WALL:-WALL] = False
        assert solid[border].all()
        assert (ndimage.binary_opening(solid, np.ones((WALL, WALL))) == solid).all()


@every
def test_only_robots_that_need_wider_ways_get_them(kind):
    for seed in SEEDS:
        small, middling, large = (building(kind, seed, passage) for passage in (10, NARROW, WIDE))
        assert (small.rooms, small.doors) == (middling.rooms, middling.doors)
        assert (large.doors == middling.doors) == (kind == "corridors")


@every
def test_buildings_differ_and_fit_a_square_of_20_m(kind):
    sizes = {building(kind, seed).size for seed in SEEDS}
    assert len(sizes) == len(SEEDS)
    assert max(map(max, sizes)) <= 20.0 / CELL_M


@furnished
@pytest.mark.parametrize(("passage", "least"), [(NARROW, 16), (WIDE, 22)])
def test_doors_lie_between_two_rooms(kind, passage, least):
    for seed in SEEDS:
        place = building(kind, seed, passage)
        for door in place.doors:
            assert sorted(door.size)[0] == WALL
            assert least <= sorted(door.size)[1] <= 22
            assert sum(door.enlarged(1).meets(room) for room in place.rooms) == 2


@furnished
def test_furniture_stands_in_rooms_and_leaves_ways_around_it(kind):
    pieces = 0
    for seed in SEEDS:
        place = building(kind, seed, WIDE)
        floors = [piece.floor for piece in place.furniture]
        pieces += len(floors)
        for i, floor in enumerate(floors):
            around = floor.enlarged(WIDE)
            assert not any(map(around.meets, [*floors[:i], *floors[i + 1 :], *place.doors]))
            (room,) = (room for room in place.rooms if room.meets(floor))
            gaps = np.abs(np.subtract(room, floor))
            assert gaps.min() == 0 or gaps.min() >= WIDE
            assert room.x0 <= floor.x0 < floor.x1 <= room.x1
            assert room.y0 <= floor.y0 < floor.y1 <= room.y1
    assert pieces > 4 * len(SEEDS)


def test_every_office_has_a_door_to_the_corridor():
    for seed in SEEDS:
        corridor, *rooms = building("offices", seed).rooms
        leading = [door for door in building("offices", seed).doors if door.enlarged(1).meets(corridor)]
        assert sorted(corridor.size)[0] in range(24, 51)
        assert all(any(door.enlarged(1).meets(room) for door in leading) for room in rooms)


def test_corridors_turn_fork_and_end():
    """How many corridors meet: one at a dead end, two at right angles at a turn, three at a fork."""
    meetings = []
    for seed in SEEDS:
        rooms = building("corridors", seed).rooms
        assert all(24 <= min(room.size) <= 50 for room in rooms)
        ends = [corner for room in rooms for corner in _ends(room)]
        meetings += [ends.count(end) for end in set(ends)]
    assert {1, 2, 3} <= set(meetings)


def test_floor_plans_have_loops_and_gaps():
    loops = [
        len(building("floor_plan", seed).doors) - len(building("floor_plan", seed).rooms) + 1
        for seed in SEEDS
    ]
    assert min(loops) >= 0
    assert max(loops) >= 2


def _ends(room):
    """The crossings, lower left corners, at both ends of a corridor."""
    width, height = room.size
    near = (room.x0, room.y0)
    return near, (("x", room.x1) if width > height else ("y", room.y1))
