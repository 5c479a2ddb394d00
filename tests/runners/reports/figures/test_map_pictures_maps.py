"""Sheets of worlds: what stands on them, that it is where it belongs, and that nothing overlaps."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.patches import Polygon

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.worlds.check import point_clearance
from runners.config.catalogue import shipped
from runners.config.map_sets import choose, known_path
from runners.reports.figures.map_pictures import COLUMNS, PANELS, Maps, extent, panels_of, sheet

OWN = ("building", "file", "tracks")  # map sets of a user's own files


@pytest.fixture(scope="module")
def every_panel():
    return [
        panel for name in shipped().titles("map") if name not in OWN for panel in panels_of(choose([name]))
    ]


@pytest.fixture(scope="module")
def page(every_panel):
    return sheet(every_panel, COLUMNS)


@pytest.mark.parametrize("columns", [1, COLUMNS])
def test_no_text_panel_or_legend_overlaps_another_or_leaves_the_page(every_panel, columns):
    figure = sheet(every_panel, columns)
    figure.canvas.draw()
    width, height = figure.get_size_inches() * figure.dpi
    boxes = [artist.get_window_extent() for artist in (*figure.axes, *figure.texts, *figure.legends)]
    boxes += [
        text.get_window_extent() for axes in figure.axes for text in axes.texts if "m" in text.get_text()
    ]
    assert len(boxes) == 1 + 4 * len(every_panel)
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    assert all(box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height for box in boxes)
    assert all(axes.get_aspect() == 1.0 for axes in figure.axes)


def test_letters_are_large_enough_for_print(page):
    assert page.get_figwidth() <= 7.0
    texts = [*page.texts, *(text for axes in page.axes for text in axes.texts)]
    assert min(text.get_fontsize() for text in texts) >= 7.0


def test_every_world_is_whole_on_its_panel(every_panel, page):
    for panel, axes in zip(every_panel, page.axes, strict=True):
        box, (x0, x1), (y0, y1) = extent(panel.task), axes.get_xlim(), axes.get_ylim()
        assert x0 < box.x0 < box.x1 < x1
        assert y0 < box.y0 < box.y1 < y1
        assert (panel.task.goal + panel.task.goal_tolerance < (x1, y1)).all()


def test_map_sets_are_described_with_their_size_and_worlds(every_panel):
    details = {panel.name: panel.detail for panel in every_panel}
    assert details["env1"] == "10 × 10 m\n50 worlds"
    assert details["real1"] == "8 × 6 m\n20 worlds"
    assert details["barn"] == "4.5 × 13 m\n100 worlds, subset lab100"


def test_movers_are_hollow_where_they_start(every_panel):
    (panel,) = [panel for panel in every_panel if panel.name == "real1_dynamic"]
    (axes,) = sheet([panel], 1).axes
    (mover,) = panel.task.world.movers
    (drawn,) = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    away = np.hypot(*(drawn.get_xy() - mover.path[0, :2]).T)
    assert away == pytest.approx(mover.radius)
    assert drawn.get_facecolor()[3] == 0.0
    assert not any("optimal" in text.get_text() for text in axes.figure.legends[0].get_texts())


def test_a_world_alone_has_metres_along_it():
    (axes,) = sheet(panels_of(choose(["barn", "42"])), COLUMNS).axes
    ticks = {float(label.get_text()): label.get_position()[1] for label in axes.get_yticklabels()}
    assert set(ticks) >= set(range(1, 14))
    assert all(place == value for value, place in ticks.items())
    assert axes.get_xlabel() == "x [m]"


@pytest.mark.parametrize("number", [0, 42, 250, 299])
def test_the_path_through_a_barn_world_keeps_clear_and_has_the_length_that_counts(number):
    chosen = choose(["barn", str(number)])
    task = chosen.maps.task(number)
    path = known_path(chosen.maps, task)
    assert path[0].tolist() == list(task.start[:2])
    assert path[-1].tolist() == task.goal.tolist()
    # Cells at least three away from a cylinder's: 0.45 m less its radius.
    assert min(point_clearance(task.world, point) for point in path[1:-1]) > 0.3
    # Counted (−0.15, −0.10) m beside the cells: only the ends differ.
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert length == pytest.approx(task.shortest_path_length, abs=2 * np.hypot(0.15, 0.10))


@pytest.mark.parametrize("words", [["env1", "3"], ["env2", "3"]])
def test_the_path_through_a_room_keeps_clear_and_has_the_length_that_counts(words):
    chosen = choose([*words, "radius=0.2"])
    task = chosen.maps.task(chosen.worlds[0])
    path = known_path(chosen.maps, task)
    assert path[[0, -1]].tolist() == [list(task.start[:2]), task.goal.tolist()]
    assert min(point_clearance(task.world, point) for point in path) >= 0.2
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert length == pytest.approx(task.shortest_path_length, abs=2 * chosen.maps.config.grid)


def test_sets_without_a_known_path_have_none():
    chosen = choose(["traps"])
    assert known_path(chosen.maps, chosen.maps.task(0)) is None


def drawn_names(monkeypatch, tmp_path, worlds=(), **settings):
    from runners.reports.figures import map_pictures as module

    seen = []
    monkeypatch.setattr(
        module, "sheet", lambda panels, columns: seen.extend(panels) or sheet(panels, columns)
    )
    (path,) = Maps(load_settings("figure/maps", **settings)).draw([], worlds, tmp_path / "maps", ["svg"])
    assert path.read_text(encoding="utf-8").startswith("<?xml")
    return seen


def test_the_kind_draws_the_sets_and_worlds_that_are_named(monkeypatch, tmp_path):
    named = ["env1", "barn 42 250", "traps kind=door"]
    panels = drawn_names(monkeypatch, tmp_path, maps=named)
    assert [panel.name for panel in panels] == ["env1", "barn 42", "barn 250", "traps"]
    assert [panel.way is not None for panel in panels] == [False, True, True, False]
    assert panels[-1].task.map_name == "trap_door"


def test_worlds_asked_for_may_be_outside_the_subset_and_the_path_can_be_left_out(monkeypatch, tmp_path):
    panels = drawn_names(monkeypatch, tmp_path, worlds=[42], maps=["barn", "barn 7"], way=False)
    assert [panel.name for panel in panels] == ["barn 42", "barn 7"]
    assert all(panel.way is None for panel in panels)


def test_null_is_every_set_but_that_of_a_users_own_file(monkeypatch, tmp_path):
    panels = drawn_names(monkeypatch, tmp_path)
    assert [panel.name for panel in panels] == [name for name in shipped().titles("map") if name not in OWN]


@pytest.mark.parametrize(
    "settings",
    [
        {"maps": ["bran"]},
        {"maps": ["barn 300"]},
        {"maps": []},
        {"columns": 0},
    ],
    ids=str,
)
def test_mistakes_are_reported_before_anything_is_drawn(settings, says):
    with says.raises(InputError):
        Maps(load_settings("figure/maps", **settings))


def test_more_worlds_than_can_be_read_are_refused(every_panel, says):
    with says.raises(InputError):
        sheet(every_panel[:1] * (PANELS + 1), COLUMNS)
