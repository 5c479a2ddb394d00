"""Fresh worlds as hard as 200–299, the hardest third of the benchmark.

The benchmark orders its worlds by difficulty, and three of its measures follow that order (correlations of about
−0.55). A fresh world counts as hard if the official world most like it in these measures is one of 200–299.
So hard fresh worlds have the measures of the official ones, with the same spread.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import cache, lru_cache

import numpy as np

from lme.types import Floats
from lme.worlds.barn.generator import Recipe, official_recipes
from lme.worlds.barn.layouts import SETTINGS, Layout, accepted_layout, first_accepted, official_layout

MEASURES = ("closest_wall", "avg_visibility", "characteristic_dimension")
HARDEST = range(200, 300)  # official numbers

_HARD = 0x68617264  # keeps the random streams of hard worlds apart from those of the other fresh ones


def hard_layout(fresh_seed: int, index: int) -> Layout:
    """Hard fresh world `index` of the seed `fresh_seed`: never an official one, always with a way through.

    It is the first hard one in its own random stream, where every world has one of the benchmark's twelve settings at
    random. A world does not depend on which others are made.
    """
    return accepted_layout(_hard_recipe(fresh_seed, index))


def most_alike(measures: Mapping[str, float]) -> int:
    """Return the official world nearest in the three measures.

    Differences count in standard deviations of the measure over the official worlds.
    """
    official = _official()
    differences = (official - [measures[name] for name in MEASURES]) / official.std(axis=0)
    return int((differences**2).sum(axis=1).argmin())


@lru_cache(maxsize=4096)
def _hard_recipe(fresh_seed: int, index: int) -> Recipe:
    for candidate in itertools.count():
        stream = (fresh_seed, index, _HARD, candidate)
        draw = int(np.random.SeedSequence(stream).generate_state(1, np.uint64)[0])
        recipe = first_accepted(stream, SETTINGS[draw % len(SETTINGS)])
        if most_alike(accepted_layout(recipe).measures()) in HARDEST:
            return recipe
    raise AssertionError("unreachable: the candidates are endless")


@cache
def _official() -> Floats:
    """(300, 3) measures of the official worlds [cells]; computing them takes a second."""
    worlds = [official_layout(number).measures() for number in official_recipes()]
    return np.array([[world[name] for name in MEASURES] for world in worlds])
