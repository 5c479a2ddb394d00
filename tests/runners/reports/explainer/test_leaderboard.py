"""The leaderboard's page in headless Chromium: sorting, details, links and names that are only text."""

import re

import pytest
from markupsafe import escape

from runners.records.run_directories import collect
from runners.reports.analysis.leaderboard import entries
from runners.reports.explainer.leaderboard import COLUMNS, write_leaderboard
from tests.composing import jobs_of
from tests.made_runs import write_run

HOSTILE = '{{RUNS}}"><script>alert("1")</script><img src=x onerror=alert(1)>'
LONG = "a_label_of_a_planner_with_a_name_that_is_longer_than_its_column"
RUNS = {  # overrides, columns
    "lme": ([], {}),
    "again": ([], {}),
    "good": (["system=lme_plus"], {"system": "LME+", "worlds": (200, 202)}),
    "slow": (["system=dwa"], {"system": "DWA", "worlds": (201, 203), "barn_metric": 0.3}),
    "cut": (["system=vfh_plus"], {"system": "VFH+", "worlds": (200,)}),
    "physics": (["sim=physics"], {}),
    "changed": (["guide.history_length=4", "planner.kp=3", "planner.kd=1"], {"system": LONG}),
    "hostile": ([], {"system": HOSTILE, "robot": HOSTILE, "map": HOSTILE, "subset": HOSTILE}),
}


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """The page of these runs, of which one has explainer pages."""
    place = tmp_path_factory.mktemp("board")
    with jobs_of() as job:
        for name, (words, columns) in RUNS.items():
            write_run(place / "eval" / name, job=job("map.worlds=[200,201]", "runs=1", *words), **columns)
    (place / "eval" / "good" / "explain").mkdir()
    (place / "eval" / "good" / "explain" / "index.html").write_text("<!doctype html>")
    (place / "eval" / "good" / "table.md").write_text("")
    frames, _ = collect([place])
    write_leaderboard(entries(frames), [f"left out {HOSTILE}"], place / "leaderboard.html")
    return place / "leaderboard.html"


@pytest.fixture
def page(open_page, board):
    opened = open_page(board)
    yield opened
    assert opened.watch.said == []
    assert opened.watch.strangers() == []


def shown(page):
    """Names of the lines of the largest setting, from top to bottom."""
    return page.locator("table").first.locator("summary").all_inner_texts()


def line(page, name):
    return page.locator("tbody tr", has=page.get_by_text(name, exact=True)).first


def header(page, name):
    return page.get_by_role("columnheader", name=name).first


def test_names_are_text_and_the_page_asks_for_nothing(board):
    text = board.read_text(encoding="utf-8")
    assert str(escape(HOSTILE)) in text
    assert "{{" not in re.sub("{{runs}}", "", text, flags=re.IGNORECASE)
    assert not re.search(r"<img|<script>alert|https?:", text)
    assert 'href="eval/good/explain/index.html"' in text


def test_a_header_sorts_and_says_so_by_click_and_by_key(page):
    success = header(page, "Success")
    assert success.get_attribute("aria-sort") == "descending"
    assert shown(page)[0] == "LME+"
    success.get_by_role("button").click()
    assert success.get_attribute("aria-sort") == "ascending"
    assert shown(page)[0] != "LME+"
    page.keyboard.press("Enter")  # the button has the focus
    assert success.get_attribute("aria-sort") == "descending"
    header(page, "System").get_by_role("button").click()
    assert success.get_attribute("aria-sort") is None
    assert shown(page) == sorted(shown(page), key=str.lower)


def test_lines_are_in_the_order_of_what_a_column_shows(page):
    for index, column in enumerate(COLUMNS):
        header(page, column.header).get_by_role("button").click()
        rows = page.locator("table").first.locator("tbody tr")
        cells = rows.evaluate_all(f"rows => rows.map((row) => row.cells[{index}].dataset.value)")
        values = [float(cell) if column.digits or column.key == "n" else cell for cell in cells if cell]
        assert values == sorted(values, reverse=column.first == "descending"), column.key
        assert "" not in cells[: len(values)], column.key


def test_an_unfinished_run_comes_last_in_both_directions(page):
    assert shown(page)[-1] == "VFH+"
    header(page, "BARN metric").get_by_role("button").click()
    assert shown(page)[-1] == "VFH+"
    page.keyboard.press("Enter")
    assert shown(page)[-1] == "VFH+"
    assert "1 of 2 worlds" in line(page, "VFH+").inner_text()


def test_figures_have_their_intervals(page):
    cells = line(page, "DWA").locator("td").all_inner_texts()
    assert cells[0].split() == ["0.500", "0.095–0.905"]
    assert cells[3].split() == ["0.300", "0.300–0.300"]


@pytest.mark.parametrize("width", [1600, 1000, 390])
def test_nothing_runs_off_the_page(open_page, board, width):
    """A narrow window scrolls a table, and not the page."""
    page = open_page(board, width=width, height=844)
    page.evaluate("document.querySelectorAll('details').forEach((details) => { details.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    outside = page.evaluate(
        """() => [...document.querySelectorAll("td, th, dd, code")].filter((element) => {
            const frame = element.closest(".wide")?.querySelector("table").getBoundingClientRect();
            return frame && element.getBoundingClientRect().right > frame.right + 1;
        }).length"""
    )
    assert outside == 0


def test_details_hold_directory_files_and_reasons(page):
    summary = line(page, "LME+").locator("summary")
    facts = line(page, "LME+").locator("dl")
    assert facts.is_hidden()
    summary.focus()
    page.keyboard.press("Enter")
    assert facts.is_visible()
    links = facts.get_by_role("link").evaluate_all("links => links.map((link) => link.getAttribute('href'))")
    assert links == ["eval/good/", "eval/good/explain/index.html", "eval/good/table.md"]
    assert "lme eval" in facts.inner_text()
    summary.click()
    assert facts.is_hidden()


def test_a_line_shows_what_is_changed_and_links_to_its_repeats(page):
    changed = line(page, LONG).locator("th > code").all_inner_texts()
    assert changed == ["guide.history_length=4", "planner.kd=1", "planner.kp=3"]
    line(page, "LME").locator("summary").click()
    facts = line(page, "LME").locator("dl").inner_text()
    assert "with the same figures" in facts
    assert len(re.findall("eval/(?:lme|again)", facts)) == 2
