"""The picture of trajectories: which worlds it shows, and that nothing in it overlaps."""

import dataclasses
import subprocess
import sys
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from lme.types import Pose
from lme.worlds.world import Task, World
from runners.reports.figures import paths as figures
from runners.reports.figures.style import saved_area
from tests.places import ROOT

OUTCOMES = ("success", "collision", "timeout")


def task(number):
    """A corridor with a disc, a wall and a box."""
    world = World(
        circles=np.array([[0.5, 3.0, 0.3]]),
        segments=np.array([[-2.0, -1.0, -2.0, 7.0], [2.0, -1.0, 2.0, 7.0]]),
        polygons=(np.array([[-1.0, 4.0], [-0.5, 4.0], [-0.5, 4.5]]),),
    )
    return Task("corridor", number, world, Pose(0, 0, 1.57), np.array([0.0, 6.0]), 0.5, 40.0, 0.0, 6.0, 6.0)


def run_of(outcomes):
    """Records and trajectories of one episode per outcome, world 0 onwards."""
    rows = [
        {"system": "LME", "map": "corridor", "world": n, "run": 0, "outcome": o}
        for n, o in enumerate(outcomes)
    ]
    y = np.linspace(0, 5.5, 20)
    steps = [
        pd.DataFrame({"world": n, "run": 0, "x_m": np.sin(y + n) / 2, "y_m": y}) for n in range(len(outcomes))
    ]
    return pd.DataFrame(rows), pd.concat(steps)


@given(st.lists(st.sampled_from(OUTCOMES), min_size=1, max_size=120))
def test_a_sample_is_as_large_as_it_can_be_and_shows_every_outcome(outcomes):
    frame, _ = run_of(outcomes)
    chosen = figures.sample_worlds(frame)
    assert len(chosen) == len(set(chosen)) == min(len(outcomes), figures.PANELS)
    assert chosen == sorted(chosen)
    assert {outcomes[number] for number in chosen} == set(outcomes)


def test_a_sample_favours_failures_but_is_not_made_of_them():
    frame, _ = run_of(["success"] * 60 + ["collision"] * 30 + ["timeout"] * 10)
    shown = [("success", "collision", "timeout")[(n >= 60) + (n >= 90)] for n in figures.sample_worlds(frame)]
    assert [shown.count(outcome) for outcome in OUTCOMES] == [4, 4, 4]


@pytest.mark.parametrize(("runs", "shown"), [(5, 5), (100, figures.RUNS)])
def test_a_panel_shows_all_runs_of_its_world_up_to_a_number_and_failures_are_among_them(runs, shown):
    outcomes = ["success"] * (runs - 2) + ["timeout", "collision"]
    rows = [{"world": w, "run": n, "outcome": o} for w in (4, 7) for n, o in enumerate(outcomes)]
    chosen = figures.sample_episodes(pd.DataFrame(rows))
    for world in (4, 7):
        numbers = [key.run for key in chosen if key.world == world]
        assert len(set(numbers)) == len(numbers) == shown
        assert {runs - 2, runs - 1} <= set(numbers)


def test_a_world_counts_by_its_worst_run():
    frame = pd.DataFrame(
        {"world": [1, 1, 2], "run": [0, 1, 0], "outcome": ["success", "collision", "success"]}
    )
    assert figures._worst_outcomes(frame) == {1: "collision", 2: "success"}


@pytest.fixture
def drawn(monkeypatch):
    """Every figure that was saved."""
    from matplotlib.figure import Figure

    saved = []
    save = Figure.savefig

    def keep(self, *arguments, **options):
        saved.append(self)
        save(self, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return saved


@pytest.mark.parametrize(
    "outcomes", [["collision"], ["success", "timeout"], ["success"] * 9 + ["collision"] * 30]
)
def test_no_text_panel_or_legend_overlaps_another(tmp_path, drawn, outcomes):
    frame, trajectories = run_of(outcomes)
    worlds = {number: task(number) for number in range(len(outcomes))}
    figures.trajectories_figure(frame, trajectories, worlds, tmp_path / "trajectories.png")
    (figure,) = drawn
    panels = [axes.get_window_extent() for axes in figure.axes]
    texts = [*figure.texts, *(axes.title for axes in figure.axes)]
    boxes = [*panels, *(text.get_window_extent() for text in texts), figure.legends[0].get_window_extent()]
    assert len(panels) == min(len(outcomes), figures.PANELS)
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    page = saved_area(figure).transformed(figure.dpi_scale_trans)
    assert all(page.contains(box.x0, box.y0) and page.contains(box.x1, box.y1) for box in boxes)
    assert all(axes.get_aspect() == 1.0 for axes in figure.axes)


@pytest.mark.parametrize(("side", "panels"), [(10.0, 4), (30.0, 5)])
def test_in_a_building_the_first_panel_shows_all_failures(tmp_path, drawn, side, panels):
    """A world larger than 20 m, the same in all tasks."""
    frame, trajectories = run_of(["success", "timeout", "collision", "timeout"])
    world = World(segments=np.array([[-2.0, -1.0, -2.0, side - 1.0], [2.0, -1.0, 2.0, side - 1.0]]))
    worlds = {number: dataclasses.replace(task(number), world=world) for number in range(4)}
    figures.trajectories_figure(frame, trajectories, worlds, tmp_path / "trajectories.png")
    (figure,) = drawn
    assert len(figure.axes) == panels
    if panels == 5:
        overview = figure.axes[0]
        assert overview.get_title() == "failures in 3 worlds"
        assert [text.get_text() for text in overview.texts] == ["1", "2", "3"]
        assert len(overview.lines) == 2 * 3  # a path and its end each


def test_each_of_several_buildings_has_its_overview_and_its_own_box(tmp_path, drawn):
    frame, trajectories = run_of(["success", "timeout", "collision", "timeout", "success", "success"])
    frame["world_building"] = [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]  # the last has no failures
    place = task(0)
    worlds = {}
    for building in range(3):
        x = 100.0 * building
        world = World(segments=np.array([[x - 2.0, -1.0, x - 2.0, 29.0], [x + 2.0, -1.0, x + 2.0, 29.0]]))
        start, goal = place.start._replace(x=place.start.x + x), place.goal + np.array([x, 0.0])
        for number in (2 * building, 2 * building + 1):
            worlds[number] = dataclasses.replace(place, world=world, start=start, goal=goal)
            trajectories.loc[trajectories["world"] == number, "x_m"] += x
    figures.trajectories_figure(frame, trajectories, worlds, tmp_path / "trajectories.png")
    (figure,) = drawn
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["failures in 1 world", "failures in 2 worlds", *(f"world {n}" for n in range(6))]
    widths = [np.ptp(axes.get_xlim()) for axes in figure.axes]
    assert widths == pytest.approx([widths[0]] * 8)  # one scale
    middles = [np.mean(axes.get_xlim()) for axes in figure.axes]
    assert middles == pytest.approx([0.0, 100.0, 0.0, 0.0, 100.0, 100.0, 200.0, 200.0], abs=1.0)
    assert {n // 2 for n in figures.sample_worlds(frame, limit=3)} == {0, 1, 2}


def test_failures_of_a_building_are_one_for_each_world():
    frame = pd.DataFrame(
        [
            {"world": n, "run": run, "outcome": "success" if n % 2 or not run else "timeout"}
            for n in range(200)
            for run in range(3)
        ]
    )
    keys = figures.failed_episodes(frame)
    assert len(keys) == figures.FAILED
    assert all(key.run == 1 and key.world % 2 == 0 for key in keys)
    assert len({key.world for key in keys}) == len(keys)


def test_the_picture_is_printable_and_in_the_colours_of_the_outcomes(tmp_path):
    frame, trajectories = run_of(OUTCOMES)
    path = tmp_path / "trajectories.png"
    figures.trajectories_figure(frame, trajectories, {n: task(n) for n in range(3)}, path)
    image = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
    assert Image.open(path).width >= 1200
    for style in figures.STYLES.values():
        colour = [int(style.colour[i : i + 2], 16) for i in (1, 3, 5)]
        assert (image == colour).all(axis=1).sum() > 100


def test_damaged_positions_do_not_keep_the_rest_from_being_drawn(tmp_path):
    frame, trajectories = run_of(OUTCOMES)
    trajectories = trajectories.astype({"x_m": object})
    for step, value in enumerate((np.nan, np.inf, None)):
        trajectories.loc[step, "x_m"] = value
    path = tmp_path / "paths.png"
    figures.trajectories_figure(frame, trajectories, {n: task(n) for n in range(3)}, path)
    assert path.is_file()


def test_the_same_records_give_the_same_picture(tmp_path):
    frame, trajectories = run_of(OUTCOMES)
    pictures = []
    for name in ("one.png", "two.png"):
        figures.trajectories_figure(frame, trajectories, {n: task(n) for n in range(3)}, tmp_path / name)
        pictures.append((tmp_path / name).read_bytes())
    assert pictures[0] == pictures[1]


def test_drawing_does_without_pyplot(tmp_path):
    """Importing it takes longer than drawing."""
    script = """
import sys
from pathlib import Path
from tests.runners.reports.figures.test_paths import *
frame, trajectories = run_of(OUTCOMES)
figures.trajectories_figure(frame, trajectories, {n: task(n) for n in range(3)}, Path(sys.argv[1]))
sys.exit("matplotlib.pyplot" in sys.modules)
"""
    picture = str(tmp_path / "trajectories.png")
    assert subprocess.run([sys.executable, "-c", script, picture], cwd=ROOT).returncode == 0
