"""The lab's hundred worlds, and fresh worlds as hard as the hardest third of the official ones."""

import csv
from collections import Counter

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.worlds.barn.generator import official_recipes
from lme.worlds.barn.layouts import HARDEST, MEASURES, fresh_layout, hard_layout, most_alike, official_layout
from lme.worlds.barn.map_set import Barn, lab100
from tests.places import SHARED

FACTS = SHARED / "facts" / "lab100.csv"


def test_the_labs_hundred():
    """25 worlds of the easiest third, 37 of the middle, 38 of the hardest; in the order of their numbers."""
    numbers = lab100()
    assert Counter(number // 100 for number in numbers) == {0: 25, 1: 37, 2: 38}
    assert list(numbers) == sorted(set(numbers))
    assert (
        Barn(load_settings("map/barn")).numbers
        == Barn(load_settings("map/barn", subset="lab100")).numbers
        == numbers
    )


@pytest.mark.skipif(not FACTS.is_file(), reason="the list of the lab's worlds is not next to the checkout")
def test_the_labs_hundred_is_the_list():
    with FACTS.open(newline="") as file:
        assert sorted(int(row["world"]) for row in csv.DictReader(file)) == list(lab100())


def test_every_official_world_is_most_like_itself():
    assert [most_alike(official_layout(number).measures()) for number in (0, 137, 299)] == [0, 137, 299]


def test_hard_worlds_depend_on_their_number_alone():
    alone = hard_layout(0, 3)
    hard = [hard_layout(0, index) for index in range(4)]
    np.testing.assert_array_equal(hard[3].grid, alone.grid)
    assert all(most_alike(layout.measures()) >= 200 for layout in hard)
    assert len({layout.recipe.seed for layout in (*hard, hard_layout(1, 3), fresh_layout(0, 3))}) == 6
    assert not {layout.recipe.seed for layout in hard} & {r.seed for r in official_recipes().values()}


@pytest.mark.slow
def test_hard_worlds_have_the_measures_of_the_hardest_third():
    """Mean and spread of a hundred, within what chance allows two samples of a hundred: three standard errors."""
    fresh = [hard_layout(0, index).measures() for index in range(100)]
    official = [official_layout(number).measures() for number in HARDEST]
    for name in MEASURES:
        ours, theirs = (np.array([world[name] for world in worlds]) for worlds in (fresh, official))
        assert ours.mean() == pytest.approx(theirs.mean(), abs=3 * theirs.std() * np.sqrt(2 / 100))
        assert 0.7 < ours.std() / theirs.std() < 1.4
