"""The lab's hundred worlds, and fresh worlds as hard as the hardest third of the official ones."""

import csv
from collections import Counter

import numpy as np
import pytest

from lme.worlds.barn.generator import official_recipes
from lme.worlds.barn.layouts import fresh_layout, hard_layout, official_layout
from lme.worlds.barn.map_set import Barn, BarnConfig
from lme.worlds.barn.measures import _OFFICIAL, HARDEST_THIRD, difficulty
from lme.worlds.barn.subsets import lab100
from tests.places import SHARED

FACTS = SHARED / "facts" / "lab100.csv"


@pytest.fixture(scope="module")
def measured():
    """Measures of the official worlds by number."""
    return [official_layout(number).measures() for number in range(300)]


def test_the_labs_hundred():
    """25 worlds of the easiest third, 37 of the middle, 38 of the hardest; in the order of their numbers."""
    numbers = lab100()
    assert Counter(number // 100 for number in numbers) == {0: 25, 1: 37, 2: 38}
    assert list(numbers) == sorted(set(numbers))
    assert Barn(BarnConfig()).numbers == Barn(BarnConfig(subset="lab100")).numbers == numbers


@pytest.mark.skipif(not FACTS.is_file(), reason="the list of the lab's worlds is not beside the checkout")
def test_the_labs_hundred_is_the_list():
    with FACTS.open(newline="") as file:
        assert sorted(int(row["world"]) for row in csv.DictReader(file)) == list(lab100())


def test_difficulty_is_measured_in_the_official_worlds(measured):
    for name, (mean, std) in _OFFICIAL.items():
        values = [world[name] for world in measured]
        assert (round(np.mean(values), 4), round(np.std(values), 4)) == (mean, std)
    hard = [difficulty(world) for world in measured]
    assert np.mean(hard) == pytest.approx(0.0, abs=1e-3)
    assert sum(value > HARDEST_THIRD for value in hard) == 100
    assert round(float(np.corrcoef(range(300), hard)[0, 1]), 2) == 0.55


def test_hard_worlds_are_hard_and_depend_on_their_number_alone():
    alone = hard_layout(0, 3)
    hard = [hard_layout(0, index) for index in range(4)]
    np.testing.assert_array_equal(hard[3].grid, alone.grid)
    assert all(difficulty(layout.measures()) > HARDEST_THIRD for layout in hard)
    assert len({layout.recipe.seed for layout in (*hard, hard_layout(1, 3), fresh_layout(0, 3))}) == 6
    assert not {layout.recipe.seed for layout in hard} & {r.seed for r in official_recipes().values()}


@pytest.mark.slow
def test_hard_worlds_are_as_hard_as_the_hardest_official_third(measured):
    """Mean measures [cells] of a hundred, against the hundred official worlds that the same rule picks."""
    fresh = [hard_layout(0, index).measures() for index in range(100)]
    official = [world for world in measured if difficulty(world) > HARDEST_THIRD]
    for name, (_, std) in _OFFICIAL.items():
        ours, theirs = (np.mean([world[name] for world in worlds]) for worlds in (fresh, official))
        assert ours == pytest.approx(theirs, abs=0.1 * std)
