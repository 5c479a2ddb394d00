"""The leaderboard's page in headless Chromium: sorting, filters, details, links and names that are only text."""

import html
import json
import re

import pytest

from runners.records.collect import collect
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
    """Names of the visible lines, from top to bottom."""
    return page.locator("tr.run:visible th button").all_inner_texts()


def line(page, name):
    return page.locator("tr.run:visible", has=page.get_by_role("button", name=name, exact=True))


def details(page, name):
    return page.locator(f"#{line(page, name).get_attribute('id').replace('run', 'more')}")


def every_setting(panel):
    """Opens the list of all keys of a run."""
    panel.get_by_text("Every setting").click()
    settings = panel.locator("details dl")
    settings.wait_for()
    return settings


def test_names_are_text_and_the_page_asks_for_nothing(board):
    text = board.read_text(encoding="utf-8")
    assert html.escape(HOSTILE) in text
    assert "{{" not in re.sub("{{runs}}", "", text, flags=re.IGNORECASE)
    assert not re.search(r"<img|<script>alert|https?:", text)
    assert 'href="eval/good/explain/index.html"' in text


def test_a_header_sorts_and_says_so_by_click_and_by_key(page):
    success = page.get_by_role("columnheader", name="Success")
    assert success.get_attribute("aria-sort") == "descending"
    assert shown(page)[0] == "LME+"
    success.get_by_role("button").click()
    assert success.get_attribute("aria-sort") == "ascending"
    assert shown(page)[0] != "LME+"
    page.keyboard.press("Enter")  # the button has the focus
    assert success.get_attribute("aria-sort") == "descending"
    page.get_by_role("columnheader", name="System").get_by_role("button").click()
    assert success.get_attribute("aria-sort") is None
    assert page.get_by_label("Order by").input_value() == "system"


def test_runs_are_sorted_within_their_setting(page):
    """No order puts a run below the heading of another setting."""

    def settings():
        return page.evaluate(
            """() => Object.fromEntries([...document.querySelectorAll("tbody[data-map]")].map((body) => {
                const runs = [...body.querySelectorAll("tr.run")].map((run) => run.id);
                return [body.rows[0].textContent, runs.sort()];
            }))"""
        )

    before = settings()
    for column in COLUMNS:
        page.get_by_label("Order by").select_option(column.key)
        assert settings() == before
        pairs = page.evaluate(
            "[...document.querySelectorAll('tr.run')].every((run) => run.nextElementSibling.className === 'more')"
        )
        assert pairs


def test_an_unfinished_run_comes_last_in_both_directions(page):
    page.get_by_label("Search").fill("lab100 fast")
    assert shown(page)[-1] == "VFH+"
    page.get_by_role("columnheader", name="BARN metric").get_by_role("button").click()
    page.keyboard.press("Enter")
    assert shown(page)[-1] == "VFH+"
    assert "1 of 2 worlds" in line(page, "VFH+").inner_text()


def test_filters_hide_runs_and_headings_without_runs(page):
    headings = page.locator("tr.setting:visible")
    every = headings.count()
    page.get_by_label("Simulator").select_option("physics")
    assert shown(page) == ["LME"]
    assert headings.count() == 1 < every
    page.get_by_label("Simulator").select_option("")
    page.get_by_label("Search").fill("history_length=4")  # a key, not a name
    assert shown(page) == [LONG]
    page.get_by_label("Search").fill("nothing is called this")
    assert shown(page) == []
    assert headings.count() == 0
    page.get_by_role("button", name="Clear the filters").click()
    assert headings.count() == every
    before = len(shown(page))
    page.get_by_label("older repeat").check()
    assert len(shown(page)) == before + 1


def test_a_line_shows_few_columns_and_few_keys(page):
    """One changed key costs one line, and a third is only counted."""
    assert page.locator("#board > thead th").count() == 7
    chips = line(page, LONG).locator(".chips")
    assert chips.locator("code").all_inner_texts() == ["guide.history_length=4", "planner.kd=1"]
    assert chips.locator("i").inner_text() == "+1"


@pytest.mark.parametrize("width", [1600, 1200, 1000, 800, 390])
def test_nothing_runs_off_the_page(open_page, board, width):
    page = open_page(board, width=width, height=844)
    for button in page.locator("tr.run:visible th button").all():
        button.click()
    for summary in page.locator("summary:visible").all():
        summary.click()
    assert page.evaluate("document.documentElement.scrollWidth") == width
    outside = page.evaluate(
        """() => [...document.querySelectorAll("#board *:not(wbr)")].filter((element) => {
            const box = element.getBoundingClientRect();
            return box.width && (box.right > innerWidth || box.left < 0);
        }).length"""
    )
    assert outside == 0


@pytest.mark.parametrize("width", [1200, 390])
def test_a_word_that_fits_is_not_broken(open_page, board, width):
    """A name of one short word takes one line of its column."""
    page = open_page(board, width=width, height=844)
    heights = page.locator("tr.run:visible th button", has_text="DWA").evaluate_all(
        "buttons => buttons.map((button) => button.getClientRects()[0].height)"
    )
    assert max(heights) < 40


def test_details_hold_directory_files_reasons_and_every_setting(page):
    button = line(page, "LME+").get_by_role("button")
    assert button.get_attribute("aria-expanded") == "false"
    panel = details(page, "LME+")
    assert panel.is_hidden()
    button.focus()
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-expanded") == "true"
    links = panel.get_by_role("link").evaluate_all("links => links.map((link) => link.getAttribute('href'))")
    assert links == ["eval/good/", "eval/good/explain/index.html", "eval/good/table.md"]
    assert "lme eval" in panel.inner_text()
    every = every_setting(panel)
    keys, values = (every.locator(part).all_inner_texts() for part in ("dt", "dd"))
    listed = dict(zip(keys, values, strict=True))
    assert listed["robot.v_max"] == "2"
    assert listed["guide._target_"].startswith("lme.guides")
    button.click()
    assert panel.is_hidden()


def test_changed_keys_stand_out_among_all(page):
    line(page, LONG).locator("td").first.click()  # anywhere on the line
    panel = details(page, LONG)
    every_setting(panel)
    changed = panel.locator(".changed dt").all_inner_texts()
    assert sorted(changed) == ["guide.history_length", "planner.kd", "planner.kp"]


def test_details_belong_to_the_run_above_them_in_any_order(page):
    """The keys are looked up by a number that sorting does not change."""
    page.get_by_role("columnheader", name="System").get_by_role("button").click()
    page.get_by_label("Simulator").select_option("physics")
    line(page, "LME").locator("td").first.click()
    settings = every_setting(details(page, "LME"))
    assert "lme.simulation.physics" in settings.locator("div", has_text="sim._target_").inner_text()


def test_a_link_to_a_run_opens_it_whatever_is_hidden(open_page, board):
    runs = json.loads(re.search(r'id="data">(.*?)</script>', board.read_text())[1])["runs"]
    for number in range(len(runs)):
        page = open_page(board, f"#run-{number}")
        assert page.locator(f"#run-{number}").is_visible()
        assert page.locator(f"#more-{number}").is_visible()


def test_as_cards_on_a_phone_lines_stay_lines_of_a_table(open_page, board):
    page = open_page(board, width=390, height=844)
    assert page.locator("#board > thead").is_hidden()
    assert line(page, "DWA").get_by_role("cell").count() == 6
    page.get_by_label("Order by").select_option("started")
    assert len(shown(page)) == len(RUNS) - 1  # one is an older repeat
