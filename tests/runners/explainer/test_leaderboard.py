"""The leaderboard's page in headless Chromium: sorting, filters, links and names that are only text."""

import html
import re

import pytest

from runners.analysis.leaderboard import entries
from runners.explainer.leaderboard import write_leaderboard
from runners.records.collect import collect
from tests.composing import jobs_of
from tests.made_runs import write_run

HOSTILE = '{{RUNS}}"><script>alert("1")</script><img src=x onerror=alert(1)>'
RUNS = {  # overrides, columns
    "lme": ([], {}),
    "again": ([], {}),
    "good": (["system=lme_plus"], {"system": "LME+", "worlds": (200, 202)}),
    "slow": (["system=dwa"], {"system": "DWA", "worlds": (201, 203), "barn_metric": 0.3}),
    "physics": (["sim=physics"], {}),
    "hostile": ([], {"system": HOSTILE, "robot": HOSTILE, "map": HOSTILE, "subset": HOSTILE}),
}


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The page of these runs, of which one has explainer pages."""
    place = tmp_path_factory.mktemp("board")
    with jobs_of() as job:
        for name, (words, columns) in RUNS.items():
            write_run(place / "eval" / name, job=job(*words), **columns)
    (place / "eval" / "good" / "explain").mkdir()
    (place / "eval" / "good" / "explain" / "index.html").write_text("<!doctype html>")
    frames, _ = collect([place])
    write_leaderboard(entries(frames), [f"left out {HOSTILE}"], place / "leaderboard.html")
    return place / "leaderboard.html"


@pytest.fixture
def page(open_page, board):
    opened = open_page(board)
    yield opened
    assert opened.watch.said == []
    assert opened.watch.strangers() == []


def shown(page, table):
    """First cells of a table's visible rows, without what stands below the name."""
    rows = page.locator("table").nth(table).locator("tbody tr:visible th")
    return [text.split("\n")[0] for text in rows.all_inner_texts()]


def test_names_are_text_and_the_page_asks_for_nothing(board):
    text = board.read_text(encoding="utf-8")
    assert html.escape(HOSTILE) in text
    assert "{{" not in text.replace(html.escape(HOSTILE), "")
    assert not re.search(r"<img|<script>alert|https?:", text)
    assert 'href="eval/good/explain/index.html"' in text


def test_a_header_sorts_and_says_so_by_click_and_by_key(page):
    success = page.get_by_role("columnheader", name="Success")
    success.get_by_role("button").click()
    assert shown(page, 1)[0] == "LME+"
    assert success.get_attribute("aria-sort") == "descending"
    page.keyboard.press("Enter")  # the button has the focus
    assert success.get_attribute("aria-sort") == "ascending"
    assert shown(page, 1)[-1] == "LME+"
    page.get_by_role("columnheader", name="System").nth(1).get_by_role("button").click()
    assert success.get_attribute("aria-sort") is None
    assert shown(page, 1)[-2:] == ["LME", "LME+"]


def test_filters_hide_rows_and_columns(page):
    columns = page.locator("table").first.locator("thead th:visible")
    assert columns.count() == 4
    page.get_by_label("Simulator").select_option("physics")
    assert columns.count() == 2
    assert shown(page, 0) == shown(page, 1) == ["LME"]
    page.get_by_label("Simulator").select_option("")
    page.get_by_label("System", exact=True).fill("dwa")
    assert shown(page, 1) == ["DWA"]
    page.get_by_label("System", exact=True).fill("")
    before = len(shown(page, 1))
    page.get_by_label("older repeats").check()
    assert len(shown(page, 1)) == before + 1


def test_a_cell_leads_to_its_run(page):
    page.get_by_label("Simulator").select_option("fast")
    page.locator("table").first.locator("tr", has_text="LME+").locator("a.figures").click()
    run = page.locator("tr:target")
    assert run.locator("th").inner_text() == "LME+\n2 of 100 worlds"
    run.get_by_role("link", name="why the robot went there").click()
    assert page.url.endswith("eval/good/explain/index.html")


def test_on_a_phone_only_the_tables_scroll(open_page, board):
    page = open_page(board, width=390, height=844)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert page.evaluate("getComputedStyle(document.querySelector('tbody th')).position") == "sticky"
