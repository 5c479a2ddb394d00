"""Random traps."""

import numpy as np
import pytest

from lme.worlds.traps import mixed

STARTS_Y, GOAL = (4.5, 5.0, 5.5), (8.5, 5.0)  # [m] starts at x = 1.5


def crosses(wall, start):
    """Whether a wall (4,) crosses the straight line from a start to the goal."""
    ends, line = np.reshape(wall, (2, 2)), np.array([start, GOAL])

    def sides(of, to):
        along, away = of[1] - of[0], to - of[0]
        return np.prod(along[0] * away[:, 1] - along[1] * away[:, 0])

    return sides(ends, line) < 0 and sides(line, ends) < 0


def drawn(seed, door=0.7):
    """(W, 4) walls of a random trap."""
    legs = mixed(np.random.default_rng(seed), door)
    return np.vstack([np.hstack([leg[:-1], leg[1:]]) for leg in map(np.array, legs)])


@pytest.mark.parametrize("door", [0.3, 0.7, 2.0])
def test_traps_block_every_straight_line_and_stay_in_the_room(door):
    for seed in range(200):
        walls = drawn(seed, door)
        assert all(any(crosses(wall, (1.5, y)) for wall in walls) for y in STARTS_Y)
        assert walls.min() >= 0.0
        assert walls.max() <= 10.0


def test_traps_differ_and_half_of_them_are_mirrored():
    traps = [drawn(seed) for seed in range(200)]
    assert len({walls.tobytes() for walls in traps}) == 200
    assert {len(walls) for walls in traps} == {1, 2, 3, 4}
    above = [walls[:, [1, 3]].mean() > 5.0 for walls in traps]
    assert 70 < sum(above) < 130
