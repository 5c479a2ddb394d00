"""Robots from above: what is drawn of them is theirs, at one scale, and nothing overlaps."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from lme.errors import InputError
from lme.robots import Footprint
from runners.cli.commands.figure import main as figure
from runners.cli.main import main
from runners.reports.figures.robot_pictures import (
    Robots,
    RobotsConfig,
    field_of_view,
    sheet,
    stopping_distance,
)
from tests.builders import shipped

NAMES = ["jackal", "go2", "stage"]


@pytest.fixture(scope="module")
def robots():
    return [shipped(name) for name in NAMES]


def test_the_outline_is_the_footprint_with_the_heading_up():
    robot = replace(shipped("jackal"), footprint=Footprint(length=0.7, width=0.4))
    (axes,) = sheet([robot], 1).axes
    _, stopped, body, *_ = (patch for patch in axes.patches if hasattr(patch, "get_xy"))
    assert np.ptp(body.get_xy(), axis=0) == pytest.approx([0.4, 0.7])
    assert np.ptp(stopped.get_xy(), axis=0) == pytest.approx([0.4, 0.7])
    moved = stopped.get_xy().max(axis=0) - body.get_xy().max(axis=0)
    assert moved == pytest.approx([0.0, stopping_distance(robot)])


def test_it_stops_a_period_and_a_ramp_after_the_command():
    robot = replace(shipped("jackal"), v_max=1.0, alpha_v=2.0, control_rate=10.0)
    assert stopping_distance(robot) == pytest.approx(0.1 + 0.25)


def test_the_field_of_view_is_that_of_the_mounted_lidar():
    lidar = replace(shipped("jackal").lidar, x=0.1, y=0.2, yaw=math.pi / 2, fov=math.pi)
    corners = field_of_view(lidar, 3.0)
    assert corners[0] == pytest.approx([0.1, 0.2])
    assert corners[1] == pytest.approx([3.1, 0.2])
    assert corners[-1] == pytest.approx([-2.9, 0.2])
    assert corners[:, 1].max() == pytest.approx(3.2)


@pytest.mark.parametrize("width", [3.5, 7.16])
def test_nothing_overlaps_and_all_are_at_one_scale(robots, width):
    figure = sheet(robots, 3 if width > 4 else 2, width)
    figure.canvas.draw()
    boxes = [axes.get_window_extent() for axes in figure.axes]
    boxes += [text.get_window_extent() for axes in figure.axes for text in (axes.title, *axes.texts)]
    boxes += [legend.get_window_extent() for legend in figure.legends]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    page = figure.bbox
    assert all(box.x0 >= page.x0 and box.x1 <= page.x1 and box.y0 >= page.y0 for box in boxes)
    assert len({round(np.ptp(axes.get_xlim()) / axes.bbox.width, 9) for axes in figure.axes}) == 1


@pytest.mark.parametrize(
    "entries", [["go3"], [""], ["jackal v_max=-1"], ["jackal nope=1"], []], ids=lambda entries: str(entries)
)
def test_what_is_wrong_with_a_list_of_robots_is_said(entries, says):
    with says.raises(InputError, match="figure.robots"):
        Robots(RobotsConfig(robots=entries, columns=3, width=7.16), shipped("jackal"))


def test_a_robot_of_ones_own_is_drawn_with_its_changes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["robot", "robot=stage", "robot.lidar.fov=3.14", "formats=[svg]", "hydra.run.dir=out"]
    assert main(["figure", *words]) == 0
    assert capsys.readouterr().out.split() == ["out/robot.svg"]
    assert "180°" in (tmp_path / "out" / "robot.svg").read_text()


@pytest.mark.parametrize("words", [["map=env1"], ["-m", "robot=jackal,go2"]])
def test_a_word_that_says_what_to_drive_is_refused(words, says):
    with says.raises(InputError, match="figure=robot drives nothing"):
        figure(["robot", *words])
