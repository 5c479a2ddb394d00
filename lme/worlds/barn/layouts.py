"""The sources of BARN worlds: official recipes, published files, and fresh seeds.

The benchmark orders its worlds by difficulty, and three of its measures follow that order (correlations of about
−0.55). A fresh world counts as hard if the official world most like it in these measures is one of 200–299, the hardest
third. So hard fresh worlds have the measures of the official ones, with the same spread.
"""

from __future__ import annotations

import itertools
import random
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from lme.errors import InputError
from lme.types import Bools, Floats, Ints
from lme.worlds.barn.files import find_worlds, path_file, read_path, read_world
from lme.worlds.barn.generator import (
    FILLS,
    SMOOTHINGS,
    Recipe,
    cylinders_of,
    grid_from,
    occupancy,
    official_recipes,
)
from lme.worlds.barn.path import barn_measures, inflated, middle_path, random_path

SETTINGS = tuple(itertools.product(FILLS, SMOOTHINGS))  # the benchmark's twelve
# Measures of difficulty, by which a world is hard.
MEASURES = ("closest_wall", "avg_visibility", "characteristic_dimension")
HARDEST = range(200, 300)  # official numbers

_HARD = 0x68617264  # keeps the random streams of hard worlds apart from those of the other fresh ones


@dataclass(frozen=True, slots=True)
class Layout:
    """One BARN world without a task.

    cylinders: (C, 3) [x, y, radius] [m]. grid: (30, 30) filled cells. path: (K, 2) cells of the benchmark's path.
    recipe: its parameters; None if they are not known.
    """

    cylinders: Floats
    grid: Bools
    path: Ints
    recipe: Recipe | None

    @property
    def fill(self) -> float:
        """Share of filled cells, without the first and last row, which are always filled."""
        return float(self.grid[1:-1].mean())

    def measures(self) -> dict[str, float]:
        """The five difficulty measures by name [cells]."""
        return barn_measures(inflated(self.grid), self.path)


def official_layout(number: int) -> Layout:
    """Official world 0…299, regenerated from its recipe."""
    return accepted_layout(official_recipes()[number])


def fresh_layout(fresh_seed: int, index: int) -> Layout:
    """Fresh world `index` of the seed `fresh_seed`: never an official one, always with a way through.

    `index` cycles through the benchmark's twelve settings. A world does not depend on which others are made.
    """
    return accepted_layout(_fresh_recipe(fresh_seed, index))


def generated_layout(recipe: Recipe) -> Layout | None:
    """The world of a recipe; None if it has no way through, so that the benchmark rejects it."""
    grid, rng = occupancy(recipe)
    path = random_path(inflated(grid), rng)
    return None if path is None else Layout(cylinders_of(grid), grid, path, recipe)


def first_accepted(stream: tuple[int, ...], setting: tuple[float, int]) -> Recipe:
    """The first accepted recipe of a random stream; in the densest settings one in hundreds is accepted."""
    official = {recipe.seed for recipe in official_recipes().values()}
    for attempt in itertools.count():
        entropy = np.random.SeedSequence([*stream, attempt])
        recipe = Recipe(int(entropy.generate_state(1, np.uint64)[0]), *setting)
        if recipe.seed not in official and generated_layout(recipe) is not None:
            return recipe
    raise AssertionError("unreachable: the attempts are endless")


def accepted_layout(recipe: Recipe) -> Layout:
    """The world of a recipe that has a way through, as all of the benchmark's do."""
    layout = generated_layout(recipe)
    assert layout is not None, "the recipe has been accepted"
    return layout


def published_layout(number: int, world_file: Path) -> Layout:
    """Read a world and its path as published; the path is planned if there is no `path_N.npy`.

    A world that differs from the official one of its number has no random stream: its planned path starts and
    ends at the free rows nearest to the middle. Raises InputError for a file that is not a BARN world or path.
    """
    cylinders = read_world(world_file)
    recipe = _matching_recipe(number, cylinders)
    grid, rng = (grid_from(cylinders), None) if recipe is None else occupancy(recipe)
    file = path_file(world_file)
    path = _checked_path(file, world_file, grid) if file.exists() else _own_path(world_file, grid, rng)
    return Layout(cylinders, grid, path, recipe)


@lru_cache(maxsize=4096)
def _fresh_recipe(fresh_seed: int, index: int) -> Recipe:
    return first_accepted((fresh_seed, index), SETTINGS[index % len(SETTINGS)])


def _matching_recipe(number: int, cylinders: Floats) -> Recipe | None:
    recipe = official_recipes().get(number)
    equal = recipe is not None and np.array_equal(cylinders_of(occupancy(recipe)[0]), np.round(cylinders, 6))
    return recipe if equal else None


def _checked_path(file: Path, world_file: Path, grid: Bools) -> Ints:
    path = read_path(file)
    if inflated(grid)[path[:, 0], path[:, 1]].any():
        raise InputError(
            f"{file} runs into the obstacles of {world_file.name}: must be the path of that world "
            "(remove the file to have one planned)"
        )
    return path


def _own_path(world_file: Path, grid: Bools, rng: random.Random | None) -> Ints:
    blocked = inflated(grid)
    path = middle_path(blocked) if rng is None else random_path(blocked, rng)
    if path is None:
        raise InputError(
            f"{world_file} has no way through that is wide enough for the benchmark's path: must have one"
        )
    return path


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


@dataclass(frozen=True, slots=True)
class ImportedWorld:
    """Comparison of an imported world with the regenerated one of the same number."""

    number: int
    cylinders: str  # "equal" | "different" | "not official"
    path: str  # "equal" | "different" | "missing" | "not official"


def import_worlds(source: Path, destination: Path) -> list[ImportedWorld]:
    """Check every world in `source`, compare it with the regenerated one, and copy worlds and paths.

    The copy in `destination` is complete or absent, and can serve as `map.source`. Raises InputError for a
    broken file, or for a destination that is not empty or cannot be written.
    """
    files = find_worlds(source)
    if destination.exists() and not (destination.is_dir() and not any(destination.iterdir())):
        raise InputError(
            f"{destination} already exists: must be a new or empty folder; nothing is overwritten"
        )
    report = [_compare(number, file) for number, file in files.items()]
    try:
        _copy_whole(list(files.values()), destination)
    except OSError as error:
        raise InputError(f"{destination} cannot be written: {error.strerror or error}") from None
    return report


def _compare(number: int, file: Path) -> ImportedWorld:
    published = published_layout(number, file)
    has_path = path_file(file).exists()
    if number not in official_recipes():
        return ImportedWorld(number, "not official", "not official" if has_path else "missing")
    same_path = np.array_equal(published.path, official_layout(number).path)
    return ImportedWorld(
        number,
        "different" if published.recipe is None else "equal",
        ("equal" if same_path else "different") if has_path else "missing",
    )


def _copy_whole(files: list[Path], destination: Path) -> None:
    """Fill a hidden folder next to the destination, then rename it."""
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=destination.parent, prefix=f".{destination.name}-") as hidden:
        filled = Path(hidden) / "worlds"
        (filled / "path_files").mkdir(parents=True)
        for file in files:
            shutil.copyfile(file, filled / file.name)
            if path_file(file).exists():
                shutil.copyfile(path_file(file), filled / "path_files" / path_file(file).name)
        if destination.exists():
            destination.rmdir()
        filled.rename(destination)
