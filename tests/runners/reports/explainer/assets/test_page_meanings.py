"""Every name of a criterion or a parameter says what it means: to the pointer, the finger, the keyboard, by ear."""

import pytest

from lme.guides.lme import criteria
from lme.guides.lme.score import CRITERIA
from tests.runners.reports.explainer.conftest import press, settle, step_of

NAMES = (*CRITERIA, "d1", "d2")
IN_TABLE = [f"#terms [data-name={name}]" for name in (*CRITERIA, "S")]
IN_PANEL = [f"label[for=p-{name}]" for name in NAMES]
SLIDERS = [f"#p-{name}" for name in NAMES]
BUBBLE = "#meaning"


def meaning(page, name):
    """What the help says of a name."""
    return page.locator(f"#about-{name}").text_content()


def shown(page):
    """What the bubble says; None where there is none."""
    return page.inner_text(BUBBLE) if page.is_visible(BUBBLE) else None


def inside(page):
    box, size = page.locator(BUBBLE).bounding_box(), page.viewport_size
    within = box["x"] + box["width"] <= size["width"] and box["y"] + box["height"] <= size["height"]
    return within and box["x"] >= 0 and box["y"] >= 0


@pytest.fixture
def away(page):
    """The shared window with the pointer at no name."""
    page.mouse.move(0, 0)
    settle(page)
    assert shown(page) is None
    return page


def test_a_criterion_means_what_its_docstring_says_first(page):
    for name in CRITERIA:
        criterion = criteria.SURMOUNT["hidden"] if name == "a_mount" else getattr(criteria, name)
        assert meaning(page, name) == criterion.__doc__.splitlines()[0]


def test_names_in_table_and_panel_are_explained_where_pointed_at(away):
    for place in (*IN_TABLE, *IN_PANEL):
        away.hover(place)
        assert shown(away) == meaning(away, away.get_attribute(place, "data-name"))
        assert inside(away), place
        away.mouse.move(0, 0)
        assert shown(away) is None, place


def test_the_keyboard_reaches_the_meaning_of_every_name(away):
    for place in (*IN_TABLE, *SLIDERS):
        away.focus(place)
        press(away, "Shift+Tab", "Tab")
        assert away.evaluate(f"document.activeElement === document.querySelector('{place}')"), place
        assert shown(away) == meaning(away, away.get_attribute(place, "data-name"))
        assert inside(away), place
        press(away, "Escape")
        assert shown(away) is None, place


def test_every_name_with_a_meaning_describes_it_to_a_screen_reader(page):
    described = page.evaluate(
        """() => Array.from(document.querySelectorAll("[data-name]"), (element) =>
            [element.dataset.name, document.getElementById(element.getAttribute("aria-describedby")).textContent])"""
    )
    assert {name for name, _ in described} == {*NAMES, "S"}
    assert all(text == meaning(page, name) for name, text in described)
    assert page.get_attribute(BUBBLE, "role") == "tooltip"


def test_names_in_sentences_are_explained(away, trace):
    press(away, "n", "n")
    names = [button.inner_text() for button in away.locator("#sentence button").all()]
    assert "d1" in names or "d2" in names
    away.hover("#sentence button")
    assert shown(away) == meaning(away, names[0])
    press(away, "End")  # nothing was decided there, so the name that was pointed at is gone
    assert away.locator("#sentence button").count() == 0
    assert shown(away) is None
    assert step_of(away) == len(trace.steps)


def test_the_focus_stays_in_the_sentence_when_the_step_changes(away):
    away.focus("#sentence button")
    press(away, "ArrowRight", "End")
    assert away.evaluate("document.activeElement.id") == "sentence"


def test_the_bubble_stays_while_the_pointer_is_on_it(away):
    away.hover("#terms [data-name=c_t]")
    away.hover(BUBBLE)
    assert shown(away) == meaning(away, "c_t")


def test_the_colours_say_what_they_stand_for(away):
    away.select_option("#colour", "c_h")
    away.hover("#colour")
    assert shown(away) == meaning(away, "c_h")
    assert away.get_attribute("#colour option[value=a_mount]", "title") == meaning(away, "a_mount")
    away.select_option("#colour", "S")


@pytest.mark.parametrize("place", ["#terms [data-name=c_o]", "label[for=p-c_o]", "#sentence button"])
def test_a_finger_opens_and_closes_it(open_page, page_file, place):
    page = open_page(page_file, "", 390, 844, has_touch=True)
    page.tap(place)
    assert shown(page) == meaning(page, page.get_attribute(place, "data-name"))
    assert inside(page)
    page.tap("#facts")
    assert shown(page) is None
