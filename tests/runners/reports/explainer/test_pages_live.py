"""The page of a drive whose world is not known: no true map, and a clearance only where something is seen."""

from dataclasses import replace

import numpy as np
import pytest

from lme.worlds.world import World
from runners.reports.explainer.write import write_page
from runners.workers.trace import Drive
from tests.runners.reports.explainer.conftest import press

ENDING = "1.07 m from the goal"


@pytest.fixture(scope="module")
def live(trace, tmp_path_factory):
    """The page of a drive as `retrace` gives it: nothing is in sight at first, and nothing is known of the end."""
    nothing = np.empty((0, 3)), np.empty((0, 4))
    rows = trace.episode.trajectory.copy()
    rows[:3, 9], rows[-1, 9] = np.inf, np.nan
    unknown = trace._replace(
        task=replace(trace.task, world=World()),
        steps=tuple(step._replace(obstacles=nothing) for step in trace.steps),
        end=trace.end._replace(obstacles=nothing),
        episode=Drive(ENDING, trace.episode.time, rows),
    )
    path = tmp_path_factory.mktemp("live") / "goal-1.html"
    write_page(unknown, path)
    return path


@pytest.fixture
def page(open_page, live):
    opened = open_page(live)
    yield opened
    assert opened.watch.said == []


def test_without_a_map_the_page_has_no_box_for_it(page):
    assert page.locator("#truth").is_hidden()
    press(page, "m")
    assert not page.locator("#truth").is_checked()


def test_clearance_is_text_where_it_is_not_a_number(page):
    assert "clearancenothing in sight" in page.locator("#facts").inner_text().replace("\n", "")
    press(page, "End")
    assert "clearancenot known" in page.locator("#facts").inner_text().replace("\n", "")
    assert "Infinity" not in page.locator("body").inner_text()


def test_the_chart_of_clearance_has_an_end(page):
    low, high = page.evaluate("(({ min, max }) => [min, max])(explainer.app.timeline.plot.scales.m)")
    assert low == 0
    assert 0 < high < 100


def test_the_end_says_what_was_left(page):
    press(page, "End")
    assert ENDING in page.locator("#subtitle").inner_text()
    assert page.locator("#choice").inner_text() == ENDING
