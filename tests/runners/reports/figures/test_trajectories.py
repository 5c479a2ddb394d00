"""The figure of several systems' paths: which panels it has, what they show, that nothing overlaps."""

import math
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.robots import Footprint
from runners.config.catalogue import shipped
from runners.config.instantiate import build
from runners.reports.figures import trajectories
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.panels import Panel, ends_before, subgoals_of
from runners.reports.figures.stage import places
from runners.reports.figures.trajectories import Trajectories, moment
from tests.runners.reports.figures.test_paths import drawn, task

__all__ = ["drawn"]  # a fixture

PATH_ROWS = 20


class Maps:
    """Corridors that differ in where their disc lies."""

    def task(self, number):
        made = task(number)
        made.world.circles[0, 0] += 0.1 * number
        return made


def job(system, outcomes, map_name="corridor"):
    """A run of one episode per world: {world: outcome}."""
    rows = [
        {"system": system, "map": map_name, "world": w, "run": 0, "outcome": o, "time_s": 12.34}
        for w, o in outcomes.items()
    ]
    robot = SimpleNamespace(footprint=Footprint(radius=0.3))
    config = SimpleNamespace(map={"name": map_name}, robot=robot)
    made = DrivenRun(Path("none"), SimpleNamespace(worlds_config=config), pd.DataFrame(rows))
    y = np.linspace(0, 5.5, PATH_ROWS)
    steps = {"run": 0, "step": np.arange(PATH_ROWS), "time_s": np.arange(PATH_ROWS) / 10, "y_m": y}
    others = {"x_m": np.sin(y) / 2, "subgoal_x_m": 0.0, "subgoal_y_m": y + 1.0, "switched": 0.0}
    each = [pd.DataFrame({"world": world, **steps, **others}) for world in outcomes]
    made.__dict__.update(maps=Maps(), trajectories=pd.concat(each))
    return made


def draw(jobs, worlds, folder, **settings):
    return Trajectories(load_settings("figure/trajectories", **settings)).draw(
        jobs, worlds, folder / "figure", ["png"]
    )


def rows_of(figure):
    """Panels by rows, by their titles and the names on their left."""
    tops = sorted({round(axes.get_position().y1, 6) for axes in figure.axes}, reverse=True)
    return [[axes for axes in figure.axes if round(axes.get_position().y1, 6) == top] for top in tops]


SYSTEMS = ["DWA (textbook)", "S3-FISVFH", "LME", "LME-DWA (textbook)", "E-Band", "VFH+"]


def several(count, worlds=(3,)):
    outcomes = ["success", "collision", "timeout"]
    names = [f"{SYSTEMS[n % 6]}{' again' * (n // 6)}" for n in range(count)]
    return [job(name, dict.fromkeys(worlds, outcomes[n % 3])) for n, name in enumerate(names)]


@pytest.mark.parametrize("layout", ["side_by_side", "overlaid"])
@pytest.mark.parametrize(
    ("count", "worlds", "width"),
    [(1, [3], 7.2), (2, [3, 4], 3.5), (6, [3, 4], 3.5), (6, [3, 4], 7.2), (1, [1, 2, 3, 4, 5], 3.5)],
)
def test_no_text_panel_or_legend_overlaps_another(tmp_path, drawn, layout, count, worlds, width):
    draw(several(count, worlds), worlds, tmp_path, layout=layout, width=width)
    (figure,) = drawn
    texts = [text for axes in figure.axes for text in (axes.title, axes.yaxis.label, *axes.texts)]
    outside = [text for text in texts if text.get_text() not in ("", "S", "G")]
    artists = [*figure.axes, *outside, figure.legends[0]]
    boxes = [artist.get_window_extent() for artist in artists]
    assert not [
        [str(one), str(other)]
        for (one, a), (other, b) in combinations(zip(artists, boxes, strict=True), 2)
        if a.overlaps(b)
    ]
    wide, high = figure.get_size_inches() * figure.dpi
    assert all(box.x0 >= 0 and box.y0 >= 0 and box.x1 <= wide + 1 and box.y1 <= high + 1 for box in boxes)
    assert all(text.get_fontsize() >= 7 for text in outside)


def test_one_column_per_system_and_one_row_per_world(tmp_path, drawn):
    draw(several(3, [3, 8]), [3, 8], tmp_path)
    rows = rows_of(drawn[0])
    assert [axes.get_title() for axes in rows[0]] == ["DWA (textbook)", "S3-FISVFH", "LME"]
    assert [row[0].get_ylabel() for row in rows] == ["world 3", "world 8"]
    assert [text.get_text() for text in drawn[0].texts] == ["corridor"]


def test_a_row_that_is_too_long_continues_below(tmp_path, drawn):
    draw(several(12), [3], tmp_path)
    assert [len(row) for row in rows_of(drawn[0])] == [6, 6]


def test_more_panels_than_fit_on_a_page_are_refused(tmp_path, says):
    with says.raises(InputError):
        draw(several(12, [1, 2, 3, 4]), [1, 2, 3, 4], tmp_path)


def test_each_panel_says_how_it_ended(tmp_path, drawn):
    draw(several(3), [3], tmp_path)
    said = [[text.get_text() for text in axes.texts] for axes in drawn[0].axes]
    assert ["success, 1.9 s" in texts for texts in said] == [True, False, False]
    assert ["collision, 1.9 s" in texts for texts in said] == [False, True, False]


def test_a_world_that_one_job_lacks_is_left_empty_there(tmp_path, drawn):
    draw([job("A", {3: "success", 4: "success"}), job("B", {4: "success"})], [3], tmp_path)
    said = [[text.get_text() for text in axes.texts] for axes in drawn[0].axes]
    assert ["not driven" in texts for texts in said] == [False, True]


def test_a_world_that_no_job_has_is_named(tmp_path, says):
    with says.raises(InputError, match="world.*9"):
        draw(several(2), [9], tmp_path)


def test_without_a_world_a_sample_is_shown_with_its_failures(tmp_path, drawn):
    outcomes = {**dict.fromkeys(range(30), "success"), 17: "timeout"}
    draw([job("A", outcomes), job("B", outcomes)], [], tmp_path)
    names = [row[0].get_ylabel() for row in rows_of(drawn[0])]
    assert len(names) == 3
    assert "world 17" in names


def test_times_count_from_the_start_as_moments_do(tmp_path, drawn):
    made = job("LME", {3: "success"})
    assert made.frame["time_s"].tolist() == [12.34]  # on the task's clock
    draw([made], [3], tmp_path)
    assert "success, 1.9 s" in [text.get_text() for text in drawn[0].axes[0].texts]


def keys_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_key_says_that_only_the_first_of_several_episodes_has_subgoals(tmp_path, drawn):
    twice = job("LME", {3: "success"})
    again = [frame.assign(run=1) for frame in (twice.frame, twice.trajectories)]
    twice.frame = pd.concat([twice.frame, again[0]])
    twice.trajectories = pd.concat([twice.trajectories, again[1]])
    draw([job("LME", {3: "success"})], [3], tmp_path, subgoals="faded")
    draw([twice], [3], tmp_path, subgoals="faded")
    assert ["subgoals: 1st episode" in keys_of(figure) for figure in drawn] == [False, True]


def test_the_key_says_that_a_robot_came_to_its_end_before_the_moment():
    early, late = job("A", {3: "success"}), job("B", {3: "success"})
    early.trajectories = early.trajectories[early.trajectories["step"] <= 10]
    (place,) = places([early, late], [3])
    panels = [Panel(each.label, place, (each,)) for each in (early, late)]
    assert [ends_before(panels, moment) for moment in (10, 11, 1.0, 1.1)] == [False, True, False, True]


def test_overlaid_systems_differ_in_colour_and_in_line(tmp_path, drawn):
    draw(several(6), [3], tmp_path, layout="overlaid")
    (axes,) = drawn[0].axes
    paths = [line for line in axes.lines if len(line.get_xdata()) == PATH_ROWS]
    assert len({line.get_color() for line in paths}) == 6
    dashes = {str(line._dash_pattern) for line in paths}
    assert len(dashes) == 6
    keys = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert keys[:6] == SYSTEMS


def test_more_systems_than_can_be_told_apart_are_refused(tmp_path, says):
    with says.raises(InputError, match="layout.*overlaid"):
        draw(several(7), [3], tmp_path, layout="overlaid")


@pytest.mark.parametrize(
    ("value", "meant"), [(None, None), (0, 0), (57, 57), ("12.5 s", 12.5), ("12.5s", 12.5), ("3 s", 3.0)]
)
def test_a_moment_is_a_step_or_a_time(value, meant):
    assert moment(value) == meant
    assert type(moment(value)) is type(meant)


@pytest.mark.parametrize("value", [-1, 12.5, "12.5", True, "soon", "-3 s", [3]])
def test_a_moment_must_be_a_step_or_a_time(value, says):
    with says.raises(InputError):
        load_settings("figure/trajectories", moment=value)


@pytest.mark.parametrize("value", [20, "2 s"])
def test_a_moment_after_every_end_is_refused(tmp_path, value, says):
    with says.raises(InputError):
        draw(several(1), [3], tmp_path, moment=value)


@pytest.mark.parametrize(
    ("key", "value"), [("layout", "stacked"), ("subgoals", "all"), ("width", 0.5), ("witdh", 3)]
)
def test_a_setting_that_makes_no_sense_is_named(key, value):
    node = {**shipped().values("figure/trajectories"), key: value}
    with pytest.raises(InputError, match=f"figure.{key}"):
        build(node, "figure")


def test_subgoals_are_the_newly_chosen_ones_and_not_the_goal():
    steps = pd.DataFrame(
        {
            "step": [0, 1, 2, 3, 4],
            "switched": [0.0, 0.0, 1.0, 1.0, 0.0],
            "subgoal_x_m": [1.0, 1.0, 2.0, 0.0, math.nan],
            "subgoal_y_m": [1.0, 1.0, 2.0, 6.0, math.nan],
        }
    )
    assert subgoals_of(steps, task(0)).tolist() == [[1.0, 1.0], [2.0, 2.0]]  # the goal is (0, 6)


def test_numbered_subgoals_leave_room_for_their_numbers(tmp_path, drawn):
    made = job("LME", {3: "success"})
    made.trajectories["switched"] = 1.0  # twenty subgoals, a quarter of a metre apart
    draw([made], [3], tmp_path, subgoals="numbered")
    (axes,) = drawn[0].axes
    numbers = [text for text in axes.texts if text.get_text().isdigit()]
    assert 2 < len(numbers) < PATH_ROWS
    assert [text.get_text() for text in numbers] == [str(n + 1) for n in range(len(numbers))]
    boxes = [text.get_window_extent() for text in numbers]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_the_scale_is_round_and_to_scale(tmp_path, drawn):
    draw(several(1), [3], tmp_path)
    (axes,) = drawn[0].axes
    label = next(text.get_text() for text in axes.texts if text.get_text().endswith(" m"))
    bar = next(line for line in axes.lines if line.get_xdata()[-1] - line.get_xdata()[0] == float(label[:-2]))
    assert float(label[:-2]) in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    assert bar.get_window_extent().y1 < axes.get_window_extent().y0
    pixels = bar.get_transform().transform(bar.get_xydata())
    left, right = pixels[:, 0].min(), pixels[:, 0].max()
    metre = axes.transData.transform((1, 0))[0] - axes.transData.transform((0, 0))[0]
    assert right - left == pytest.approx(float(label[:-2]) * metre)


def test_a_sweep_with_one_system_gets_no_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(trajectories, "runs_of", lambda frame, run_dirs: several(1))
    assert trajectories.side_by_side_figure(pd.DataFrame(), [], tmp_path) == []
