"""The explainer page in a browser: it opens from the disk alone, follows mouse, keys and address."""

import re

import numpy as np
import pytest

from lme.geometry.frames import to_world
from lme.guides.lme.explanation import reason
from lme.perception.scan_points import obstacle_points
from runners.reports.explainer.encode import CELL_M
from tests.runners.reports.explainer.conftest import press, settle, step_of, until


def sentence(page):
    return page.inner_text("#sentence")


def expected(trace, step):
    before = trace.steps[step - 1].explanation if step else None
    text = reason(trace.steps[step].explanation, before)
    return text[0].upper() + text[1:]


def go(page, step):
    page.evaluate(f"explainer.app.playback.go({step})")
    settle(page)


def test_the_page_opens_from_the_disk_and_requests_nothing(page, trace):
    assert page.inner_text("h1") == "trap_u 1, run 0"
    assert "turtlebot2 · success after" in page.inner_text("#subtitle")
    assert step_of(page) == 0
    assert sentence(page) == expected(trace, 0)
    assert page.watch.strangers() == []
    assert page.watch.said == []


def test_the_page_cannot_connect_to_anywhere(open_page, page_file):
    other = open_page(page_file)
    assert other.evaluate("fetch('https://example.org').then(() => 'answered', () => 'refused')") == "refused"
    assert any("Content Security Policy" in text for text in other.watch.said)


def test_keys_scrub(page, trace):
    press(page, "ArrowRight", "ArrowRight", "ArrowRight")
    assert step_of(page) == 3
    assert sentence(page) == expected(trace, 3)
    press(page, "Shift+ArrowRight", "ArrowLeft")
    assert step_of(page) == 12
    assert sentence(page) == expected(trace, 12)
    press(page, "End")
    assert step_of(page) == len(trace.steps)
    assert sentence(page).startswith("The end: success")
    press(page, "Shift+ArrowLeft")
    assert step_of(page) == len(trace.steps) - 10
    press(page, "Home")
    assert step_of(page) == 0


def test_the_slider_scrubs_and_the_address_follows(page, trace):
    page.focus("#step")
    press(page, "ArrowRight", "Shift+ArrowRight")
    assert step_of(page) == 11
    assert sentence(page) == expected(trace, 11)
    page.fill("#step", "40")
    until(page, "location.hash === '#step=40'")
    assert step_of(page) == 40


def test_the_address_leads_to_a_step_and_moves_the_page(open_page, page_file, page):
    other = open_page(page_file, "#step=57")
    assert step_of(other) == 57
    assert other.input_value("#step") == "57"
    page.evaluate("location.hash = '#step=33'")
    until(page, "explainer.app.playback.step === 33")
    page.evaluate("location.hash = '#step=99999'")  # there is none: the end
    until(page, "explainer.app.playback.step === explainer.trace.last")


def test_the_timeline_can_be_clicked(page, trace):
    box = page.locator("#chart .u-over").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 10)
    settle(page)
    assert abs(step_of(page) - len(trace.steps) / 2) <= 1


def test_n_and_p_go_from_switch_to_switch(page, trace):
    switches = [i for i, m in enumerate(trace.steps) if m.explanation.decision.choice.switched]
    press(page, "n")
    assert step_of(page) == switches[0]
    press(page, "n", "n", "p")
    assert step_of(page) == switches[1]


def test_the_page_plays_and_pauses_and_announces_the_pause(page, trace):
    spoken = page.locator("#spoken")
    go(page, 2)
    until(page, "document.getElementById('spoken').textContent.startsWith('Step 2')")
    assert expected(trace, 2)[1:] in spoken.inner_text()
    page.select_option("#speed", "5")
    page.evaluate(
        """() => {
            window.changes = 0;
            const watch = new MutationObserver(() => window.changes++);
            watch.observe(document.getElementById("spoken"), { childList: true });
        }"""
    )
    page.click("#play")
    until(page, "document.getElementById('play').getAttribute('aria-label') === 'Pause'")
    until(page, "explainer.app.playback.step > 20")
    assert page.evaluate("changes") == 0
    page.click("#play")
    rested = step_of(page)
    until(page, "changes === 1")
    assert spoken.inner_text().startswith(f"Step {rested},")
    assert spoken.get_attribute("aria-live") == "polite"
    assert page.get_attribute("#scene", "aria-label").startswith(
        f"The robot seen from above at step {rested} of"
    )
    page.select_option("#speed", "1")


def test_candidates_are_stepped_through_in_the_order_of_their_scores(page, trace):
    go(page, 5)
    scores = trace.steps[5].explanation.scores
    order = np.argsort(-scores, kind="stable")
    for place in range(3):
        press(page, "ArrowDown")
        assert page.inner_text("#candidate").startswith(
            f"Candidate {order[place]}: rank {place + 1} of {len(scores)}"
        )
    press(page, "ArrowUp")
    assert f"Candidate {order[1]}:" in page.inner_text("#candidate")
    until(page, "document.getElementById('spoken').textContent.startsWith('Candidate')")
    press(page, "Escape")
    assert page.inner_text("#candidate").startswith("The best candidate.")


def test_colours_can_be_those_of_a_criterion_with_numbers(page, trace):
    why = trace.steps[0].explanation
    page.select_option("#colour", "a_close")
    settle(page)
    low, high = np.percentile(why.features[0], [5, 95])
    shown = [
        re.sub("[≤≥ ]", "", text.replace("\u2212", "-"))
        for text in page.locator("#legend b").all_inner_texts()
    ]
    assert float(shown[0]) == pytest.approx(low, abs=0.006)
    assert float(shown[2]) == pytest.approx(high, abs=0.006)
    page.select_option("#colour", "S")


def test_the_world_is_what_was_seen_up_to_the_step(page, trace):
    step = 20
    seen = np.concatenate(
        [
            to_world(obstacle_points(m.observation.scan, trace.robot.lidar.mount), m.pose)
            for m in trace.steps[: step + 1]
        ]
    )
    cells = {tuple(cell) for cell in np.floor(seen / CELL_M).astype(int).tolist()}
    shown = page.evaluate(
        """(step) => Array.from({ length: explainer.trace.starts.seen[step + 1] },
            (_, i) => [explainer.trace.arrays["seen.x"][i], explainer.trace.arrays["seen.y"][i]])""",
        step,
    )
    assert len(shown) == len(cells)
    assert {tuple(cell) for cell in shown} == cells


def test_neighbouring_sectors_differ_and_the_blocking_one_has_its_ends(page, trace):
    step = next(i for i, m in enumerate(trace.steps) if m.explanation.view.blockage is not None)
    way = trace.steps[step].explanation.view.blockage
    trace_js = "explainer.trace"
    ends = page.evaluate(
        f"""(step) => {{
            const {{ arrays, starts }} = {trace_js};
            const at = starts.sectors[step] + arrays.blocking[step];
            return [0, 1].map((i) => starts.scan[step] + arrays.sectors[2 * at + i])
                .map((i) => [arrays["scan.x"][i] / 1000, arrays["scan.y"][i] / 1000]);
        }}""",
        step,
    )
    np.testing.assert_allclose(ends, [way.E1, way.E2], atol=0.00051)
    for count in range(2, 14):
        colours = page.evaluate(
            f"Array.from({{ length: {count} }}, (_, k) => explainer.sectorColour(k, {count}))"
        )
        assert all(one != two for one, two in zip(colours, colours[1:] + colours[:1], strict=True))


def test_every_control_is_reached_by_tab_and_shows_its_focus(page):
    wanted = page.evaluate(
        """() => [...document.querySelectorAll("main :is(button, input, select, canvas[tabindex]), header button")]
            .filter((element) => !element.disabled && element.checkVisibility()).map((element) => element.id
                || element.getAttribute("aria-label"))"""
    )
    met = []
    page.focus(f"#{wanted[0]}")
    for place in range(len(wanted)):
        page.keyboard.press("Tab" if place else "Shift")
        name, outline = page.evaluate(
            """() => [document.activeElement.id || document.activeElement.getAttribute("aria-label"),
                getComputedStyle(document.activeElement).outlineStyle]"""
        )
        assert outline == "solid", name
        met.append(name)
    assert met == wanted  # in the order of the page, and none holds the focus
    names = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select")].filter((element) =>
            !(element.getAttribute("aria-label") || element.labels?.length || element.textContent.trim()))
            .map((element) => element.outerHTML)"""
    )
    assert names == []


def test_help_opens_by_key_and_closes(page):
    press(page, "?")
    assert page.locator("#help").is_visible()
    assert "next, last switch" in page.inner_text("#help")
    press(page, "ArrowRight", "Escape")
    assert page.locator("#help").is_hidden()
    assert step_of(page) == 0


def test_the_page_takes_the_colours_of_the_system_or_those_chosen(page):
    def ground():
        return page.evaluate("getComputedStyle(document.querySelector('section')).backgroundColor")

    page.emulate_media(color_scheme="dark")
    dark = ground()
    page.emulate_media(color_scheme="light")
    light = ground()
    assert light != dark
    page.click("#theme")
    assert ground() == dark
    settle(page)
    first = "Array.from(document.getElementById('scene').getContext('2d').getImageData(2, 2, 1, 1).data.slice(0, 3))"
    assert f"rgb({', '.join(map(str, page.evaluate(first)))})" == dark  # the canvas too
    page.click("#theme")
    assert ground() == light
