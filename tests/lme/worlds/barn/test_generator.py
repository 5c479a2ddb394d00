"""Official worlds: regenerated exactly."""

import csv
import hashlib
import itertools
import re
from collections import Counter

import numpy as np
import pytest

from lme.inputs.resources import resource_dir
from lme.types import Pose
from lme.worlds.barn.files import find_worlds, path_file, read_path, read_world
from lme.worlds.barn.generator import (
    FILLS,
    GRID_CELLS,
    SMOOTHINGS,
    Recipe,
    cylinders_digest,
    grid_from,
    occupancy,
    official_recipes,
)
from lme.worlds.barn.layouts import fresh_layout, official_layout
from lme.worlds.barn.path import (
    avg_visibility,
    barn_measures,
    benchmark_length,
    dispersion,
    inflated,
    middle_path,
    path_digest,
    plan,
)
from tests.places import SHARED

PUBLISHED = SHARED / "barn"
FIGURES = SHARED / "facts" / "barn_metrics.csv"
COLUMNS = {
    "closest_wall": "closest_wall",
    "avg_visibility": "avg_vis",
    "dispersion": "dispersion",
    "characteristic_dimension": "char_dim",
    "tortuosity": "tortuosity",
}
LAST_DIGIT = 0.51e-4  # the reference figures have four decimals

needs_published = pytest.mark.skipif(
    not PUBLISHED.is_dir(), reason="published BARN files are not next to the checkout"
)
needs_figures = pytest.mark.skipif(
    not FIGURES.is_file(), reason="reference figures are not next to the checkout"
)


@pytest.fixture(scope="module")
def layouts():
    return {number: official_layout(number) for number in official_recipes()}


def test_every_world_and_path_has_the_recorded_checksum(layouts):
    with (resource_dir("maps") / "barn" / "checksums.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["world"]) for row in rows] == list(range(300))
    for row in rows:
        layout = layouts[int(row["world"])]
        assert len(layout.cylinders) == int(row["cylinders"])
        assert cylinders_digest(layout.cylinders) == row["cylinders_sha256"], row["world"]
        assert path_digest(layout.path) == row["path_sha256"], row["world"]


def test_the_tables_have_the_checksums_of_the_readme():
    text = (resource_dir("maps") / "README.md").read_text(encoding="utf-8")
    for name, digest in re.findall(r"`(\w+\.csv)`.*`([0-9a-f]{64})`", text):
        assert hashlib.sha256((resource_dir("maps") / "barn" / name).read_bytes()).hexdigest() == digest, name


def test_twenty_five_worlds_fit_each_setting():
    """A world that has settled comes out of further smoothings as well: the settings' counts have a range."""
    only, also = Counter(), Counter()
    for seed, fill, smoothings in official_recipes().values():
        world = occupancy(Recipe(seed, fill, smoothings))[0]
        fits = [k for k in SMOOTHINGS if np.array_equal(occupancy(Recipe(seed, fill, k))[0], world)]
        assert smoothings in fits
        also.update((fill, k) for k in fits)
        only.update((fill, k) for k in fits if len(fits) == 1)
    for setting in itertools.product(FILLS, SMOOTHINGS):
        assert only[setting] <= 25 <= also[setting]


@needs_published
def test_published_worlds_are_regenerated_cylinder_for_cylinder(layouts):
    files = find_worlds(PUBLISHED)
    assert len(files) >= 100
    for number, file in files.items():
        np.testing.assert_array_equal(read_world(file), layouts[number].cylinders, err_msg=str(number))
        np.testing.assert_array_equal(read_path(path_file(file)), layouts[number].path, err_msg=str(number))


@needs_figures
def test_lengths_and_measures_are_the_reference_figures(layouts):
    with FIGURES.open(newline="") as file:
        for row in csv.DictReader(file):
            layout = layouts[int(row["world"])]
            length = benchmark_length(layout.path, Pose(-2.25, 3.0, 0.0), np.array([-2.25, 13.0]))
            assert abs(length - float(row["path_len_m"])) < LAST_DIGIT
            for name, value in barn_measures(inflated(layout.grid), layout.path).items():
                assert abs(value - float(row[COLUMNS[name]])) < LAST_DIGIT, (row["world"], name)


def test_optimal_times_have_the_published_range(layouts):
    start, goal = Pose(-2.25, 3.0, 0.0), np.array([-2.25, 13.0])
    times = [benchmark_length(layout.path, start, goal) / 2.0 for layout in layouts.values()]
    assert round(min(times), 2) == 5.03
    assert round(max(times), 2) == 6.87
    assert round(float(np.mean(times)), 2) == 5.71


def test_cylinders_alone_give_the_same_path_and_measures(layouts):
    """Solid blocks have no cylinders inside; what is closed in on all sides changes nothing outside."""
    for layout in list(layouts.values())[::7]:
        blocked, again = inflated(layout.grid), inflated(grid_from(layout.cylinders))
        ends = tuple(map(int, layout.path[0])), tuple(map(int, layout.path[-1]))
        np.testing.assert_array_equal(plan(again, *ends), layout.path)
        assert barn_measures(again, layout.path) == barn_measures(blocked, layout.path)


def test_a_grid_without_a_way_through_has_no_path():
    blocked = np.zeros((GRID_CELLS, GRID_CELLS), dtype=bool)
    blocked[:, 15] = True
    assert middle_path(blocked) is None
    assert plan(blocked, (15, 0), (15, 29)) is None


def test_measures_of_a_straight_corridor():
    """Rows 10 and 14 blocked, the path along row 12 between them, all thirty columns.

    The nearest wall is 2 away everywhere. Free widths: 29 along, 2 across, 2√2 on the diagonals, of which
    one half (√2) is cut off at columns 0 and 29. Around cell (12, 15) all directions but the two along the
    corridor meet a wall, (±1, ±2) at their second step: free, 7 walls, free, 7 walls: 4 alternations.
    """
    blocked = np.zeros((GRID_CELLS, GRID_CELLS), dtype=bool)
    blocked[[10, 14]] = True
    path = np.array([(12, column) for column in range(GRID_CELLS)])
    measures = barn_measures(blocked, path)
    assert measures["closest_wall"] == 2.0
    assert measures["tortuosity"] == 1.0
    assert measures["characteristic_dimension"] == pytest.approx((28 * 2 + 2 * 2**0.5) / 30)
    assert dispersion(blocked, path[15:16]) == 4.0


def test_visibility_in_the_open():
    """From cell (0, 0) of an empty grid: 30 along row and column, 30√2 on the diagonal, itself elsewhere."""
    blocked = np.zeros((GRID_CELLS, GRID_CELLS), dtype=bool)
    rays = 30 + 30 + 30 * 2**0.5 + 2 * 1 + 3 * 2**0.5
    assert avg_visibility(blocked, np.array([(0, 0)])) == pytest.approx(rays / 8)


def test_fresh_worlds_cycle_through_the_settings_and_are_never_official():
    layouts = [fresh_layout(7, index) for index in range(9)]
    settings = [(layout.recipe.fill, layout.recipe.smoothings) for layout in layouts]
    assert settings == list(itertools.product(FILLS, SMOOTHINGS))[:9]
    official = {recipe.seed for recipe in official_recipes().values()}
    assert not {layout.recipe.seed for layout in layouts} & official
    assert len({cylinders_digest(layout.cylinders) for layout in layouts}) == 9


def test_fresh_worlds_differ_between_streams_and_repeat_within_one():
    digests = [cylinders_digest(fresh_layout(seed, 0).cylinders) for seed in (1, 2, 1)]
    assert digests[0] == digests[2] != digests[1]
