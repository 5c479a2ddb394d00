"""The explainer page under odd hands: keys pressed fast, other mouse buttons, focus, and what is read out."""

import pytest

from lme.guides.lme.maintenance import Choice
from tests.runners.reports.explainer.conftest import press, settle, step_of, until


def test_keys_pressed_within_a_frame_do_not_play_it_faster(page, trace):
    steps, seconds = page.evaluate(
        """async () => {
            const { playback } = explainer.app;
            for (let i = 0; i < 9; i++) playback.toggle();
            const begun = performance.now();
            await new Promise((done) => setTimeout(done, 600));
            playback.pause();
            return [playback.step, (performance.now() - begun) / 1000];
        }"""
    )
    assert 1 <= steps <= seconds / trace.robot.dt + 1


def test_a_page_that_was_hidden_plays_on_from_where_it_was(page, trace):
    page.select_option("#speed", "5")
    page.evaluate(
        """() => {
            explainer.app.playback.play();
            const begun = performance.now();
            while (performance.now() - begun < 800); // no frames either
        }"""
    )
    settle(page)
    assert 0 < step_of(page) < 5 * 0.5 / trace.robot.dt
    page.select_option("#speed", "1")


def test_the_right_button_does_not_hold_the_map(page):
    box = page.locator("#scene").bounding_box()
    camera = "[explainer.app.scene.camera.x, explainer.app.scene.camera.y]"
    before = page.evaluate(camera)
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down(button="right")
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.up(button="right")
    settle(page)
    assert page.evaluate(camera) == before
    page.mouse.down()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.up()
    assert page.evaluate(camera) != before  # the left one does
    page.click("#fit")


@pytest.mark.parametrize("button", ["better", "reset-all"])
def test_a_button_of_no_more_use_leaves_the_focus_on_the_page(page, button):
    page.evaluate("explainer.app.panel.set({ d2: 0 })")
    settle(page)
    page.focus(f"#{button}")
    press(page, "Enter", "End")
    assert page.evaluate(
        "document.activeElement.checkVisibility() && document.activeElement.matches('button, input')"
    )
    press(page, "Enter")
    assert (
        page.get_attribute("#better", "aria-disabled")
        == str(step_of(page) == page.evaluate("explainer.trace.last")).lower()
    )


def test_one_live_region_announces_what_a_slider_did(page):
    spoken = "document.getElementById('spoken').innerText"
    live = "[aria-live]:not([aria-live=off]), [role=status], [role=alert], [role=log], output"
    assert page.eval_on_selector_all(live, "(them) => them.map((one) => one.id)") == ["spoken"]
    page.focus("#p-d2")
    press(page, "Home")
    until(page, "document.getElementById('what-if').textContent.includes('decisions would differ')")
    until(page, f"{spoken}.includes(document.getElementById('what-if').innerText)")
    page.evaluate("explainer.app.playback.go(3)")
    until(page, f"{spoken}.startsWith('Step 3')")
    assert "decisions would differ" in page.inner_text("#spoken")  # while another setting holds


def test_keys_without_a_use_are_left_to_the_browser(page):
    taken = """() => {
        const event = new KeyboardEvent("keydown", { key: "ArrowDown", bubbles: true, cancelable: true });
        document.body.dispatchEvent(event);
        return event.defaultPrevented;
    }"""
    assert page.evaluate(taken) is True  # the next candidate
    press(page, "End")
    assert page.evaluate(taken) is False  # none there: the page scrolls


def test_names_in_the_scene_do_not_cover_one_another(page, trace):
    switches = [i for i, m in enumerate(trace.steps) if m.explanation.decision.choice is not Choice.KEPT]
    names = page.evaluate(
        """(steps) => {
            const { app } = explainer;
            const drawn = [];
            app.scene.camera.scale = 12; // small, as on a phone
            const plain = CanvasRenderingContext2D.prototype.fillText;
            CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
                if (/^[EB]/.test(text)) drawn.at(-1).push([this.measureText(text).width, x, y]);
            };
            const shown = { truth: false, changed: false, picked: null, scale: { low: 0, high: 1 } };
            for (const step of steps) {
                drawn.push([]);
                const values = new Float64Array(explainer.trace.candidates(step));
                app.scene.draw({ ...shown, step, values, verdict: app.verdicts[step] });
            }
            CanvasRenderingContext2D.prototype.fillText = plain;
            app.fit();
            return drawn;
        }""",
        switches,
    )
    assert any(len(some) == 3 for some in names)
    for some in names:
        for i, (wide, x, y) in enumerate(some):
            for other_wide, other_x, other_y in some[:i]:
                assert abs(x - other_x) >= (wide + other_wide) / 2 or abs(y - other_y) >= 11, some
