"""The explainer page elsewhere: on a phone, in a frame, and of other episodes."""

import dataclasses
import re
import shlex

import numpy as np
import pytest

from lme.errors import InputError
from lme.guides.lme.maintenance import Choice
from runners.reports.explainer.write import write_page
from tests.runners.reports.explainer.conftest import press, settle, step_of, traced, until

FIT = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"


@pytest.mark.parametrize(("width", "height"), [(360, 740), (820, 1180), (1280, 720)])
def test_nothing_is_wider_than_the_window(page, width, height):
    page.set_viewport_size({"width": width, "height": height})
    settle(page)
    assert page.evaluate(FIT)
    box = page.locator("#scene").bounding_box()
    assert box["width"] > 0.6 * width
    assert box["height"] > 0.35 * height


def test_a_tap_shows_a_candidates_terms(open_page, page_file):
    phone = open_page(page_file, "#step=20", 390, 844, has_touch=True, is_mobile=True)
    x, y = phone.evaluate(
        """() => {
            const box = document.getElementById("scene").getBoundingClientRect();
            const { spots, camera } = explainer.app.scene;
            const spot = spots.find(([x, y]) => x > 20 && y > 60 && x < camera.width - 20 && y < camera.height - 20);
            return [box.x + spot[0], box.y + spot[1]];
        }"""
    )
    phone.touchscreen.tap(x, y)
    settle(phone)
    assert re.match(r"Candidate \d+: rank", phone.inner_text("#candidate"))
    assert phone.evaluate(FIT)
    assert phone.watch.said == []


def test_the_page_works_in_a_sandboxed_frame(browser, page_file, tmp_path):
    frame = page_file.read_text("utf-8").replace("&", "&amp;").replace('"', "&quot;")
    outer = tmp_path / "outer.html"
    outer.write_text(f'<iframe sandbox="allow-scripts" width="900" height="600" srcdoc="{frame}"></iframe>')
    page = browser.new_page()
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(outer.as_uri())
    inner = page.frames[1]
    inner.wait_for_selector("body.ready")
    inner.click("#forward")
    inner.click("#theme")
    until(inner, "explainer.app.playback.step === 1")
    page.wait_for_timeout(250)  # until the address would follow
    assert said == []
    page.close()


def test_a_guide_without_reasons_has_its_drive_shown(open_page, tmp_path):
    path = tmp_path / "bare.html"
    bare = traced(0, "map=traps", "robot=turtlebot2", "guide=target", "planner=dwa", "map.time_limit=6")
    write_page(bare, path)
    page = open_page(path, "#step=4")
    assert "This guide gives no reasons" in page.inner_text("#decision")
    assert page.inner_text("#sentence").startswith("Heads for a subgoal")
    assert page.locator("#reasons").is_hidden()
    assert page.locator("#others").is_hidden()
    press(page, "ArrowRight", "ArrowDown", "n", "End")
    assert step_of(page) == len(bare.steps)
    assert page.watch.said == []


def test_a_planned_path_is_drawn_and_the_end_shows_the_tasks_clock(open_page, tmp_path):
    path = tmp_path / "planned.html"
    planned = traced(
        230, "sim=fast", "map.worlds=[230]", "guide=global_path", "planner=eband", "map.time_limit=4"
    )
    write_page(planned, path, "E-Band")
    page = open_page(path, "#step=5")
    shown = page.evaluate(
        """() => {
            const { arrays, starts } = explainer.trace;
            const [from, to] = starts.plan.subarray(5, 7);
            const metres = (name) => Array.from(arrays[name].subarray(from, to), (value) => value / 1000);
            return [metres("plan.x"), metres("plan.y")];
        }"""
    )
    np.testing.assert_allclose(shown, planned.steps[5].guidance.path.T, atol=0.00051)
    assert page.get_by_text("planned", exact=True).is_visible()
    assert page.inner_text("#subtitle") == "E-Band · jackal · timeout after 4.0 s"
    press(page, "End")
    late = planned.episode.trajectory[-1, 0] - planned.episode.time
    assert late > 0.05  # or there is nothing to tell
    assert page.inner_text("#sentence") == (
        f"The end: timeout after 4.0 s by the clock of its task, which started {late:.1f} s into the drive. "
        "No decision follows."
    )
    assert page.watch.said == []


def test_without_a_plan_the_legend_has_no_entry_for_one(page):
    assert page.get_by_text("planned", exact=True).is_hidden()


def test_a_long_name_breaks(open_page, trace, tmp_path):
    long = trace._replace(task=dataclasses.replace(trace.task, map_name="map_" * 50))
    write_page(long, tmp_path / "long.html", "system_" * 50)
    assert open_page(tmp_path / "long.html", "", 360, 740).evaluate(FIT)


def test_a_browser_that_is_too_old_gets_a_note(browser, page_file):
    page = browser.new_page()
    page.add_init_script("CSS.supports = () => false")
    page.goto(page_file.as_uri())
    until(page, "document.getElementById('title').textContent === 'This page cannot be shown'")
    assert "May 2024" in page.inner_text("#subtitle")
    page.close()


def test_moving_obstacles_are_drawn_where_they_are(open_page, tmp_path):
    path = tmp_path / "moving.html"
    moving = traced(
        0,
        "map=real1_dynamic",
        "robot=turtlebot2",
        "map.time_limit=20",
        "ablation=no_maintenance",
        "guide.surmount=hidden",
    )
    last = len(moving.steps) - 1
    write_page(moving, path)
    page = open_page(path)
    still = len(moving.task.world.circles), len(moving.task.world.edges)
    shown = page.evaluate(
        f"[0, {last}].map((step) => ['discs', 'edges'].map((name, i) => Array.from(explainer.trace.arrays[name]"
        ".subarray(...explainer.trace.span(name, step).map((row) => row * (3 + i))))))"
    )
    for step, parts in zip((0, last), shown, strict=True):
        for part, obstacles, first in zip(parts, moving.steps[step].obstacles, still, strict=True):
            np.testing.assert_allclose(part, obstacles[first:].ravel(), rtol=1e-6)
    assert shown[0] != shown[1]
    assert page.input_value("#n-d1") == "∞"  # no maintenance
    assert not any(page.evaluate("explainer.app.changed"))
    choices = {step.explanation.decision.choice for step in moving.steps}
    assert choices == {Choice.FIRST, Choice.REACHED}
    page.check("#truth")
    settle(page)
    assert page.watch.said == []


def test_less_motion_is_heeded(open_page, page_file):
    calm = open_page(page_file, reduced_motion="reduce")
    assert calm.evaluate("explainer.app.playback.speed") == 0.25
    assert calm.evaluate("getComputedStyle(document.getElementById('play')).transitionDuration") == "0s"


@pytest.mark.parametrize("kept", [0, 1])
def test_an_episode_that_ends_at_once_in_an_empty_world(open_page, trace, tmp_path, kept):
    nothing = np.full_like(trace.end.observation.scan.ranges, np.inf)
    unseen = trace.end.observation._replace(scan=trace.end.observation.scan._replace(ranges=nothing))
    track = trace.episode.trajectory
    short = dataclasses.replace(trace.episode, trajectory=np.vstack([track[:kept], track[-1:]]))
    steps = tuple(step._replace(observation=unseen) for step in trace.steps[:kept])
    write_page(
        trace._replace(steps=steps, episode=short, end=trace.end._replace(observation=unseen)),
        tmp_path / "short.html",
    )
    page = open_page(tmp_path / "short.html")
    press(page, "End", "ArrowLeft", "f", "m", "0", "n")
    assert page.watch.said == []
    assert page.get_by_text("The episode ended before the first decision.").is_visible() is (kept == 0)


def test_a_place_that_takes_no_file_is_named(trace, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_page(trace, tmp_path / "missing" / "page.html")


def test_tracked_people_are_drawn_where_they_are_seen(open_page, tmp_path, trace):
    tracked = traced(60, "system=lme_plus", "map=dynabarn", "map.difficulty=hard", "people=tracked")
    write_page(tracked, tmp_path / "people.html")
    page = open_page(tmp_path / "people.html")
    step = max(range(len(tracked.steps)), key=lambda k: len(tracked.steps[k].observation.pedestrians))
    shown = page.evaluate(
        "(step) => Array.from(explainer.trace.arrays.people"
        ".subarray(...explainer.trace.span('people', step).map((row) => 4 * row)))",
        step,
    )
    people = tracked.steps[step].observation.pedestrians
    assert len(people) > 2
    np.testing.assert_allclose(shown, people.ravel(), rtol=1e-6)
    assert page.is_visible("#key-people")
    page.close()
    write_page(trace, tmp_path / "nobody.html")
    assert not open_page(tmp_path / "nobody.html").is_visible("#key-people")


def test_a_page_of_a_run_says_how_to_play_on_from_its_step(trace, tmp_path, open_page):
    folder = tmp_path / "it's mine" / "explain"
    folder.mkdir(parents=True)
    write_page(trace, folder / "1-0.html", play="RUN 1/0")
    page = open_page(folder / "1-0.html", "#step=7")
    words = shlex.split(page.text_content("#play-here code"))
    assert words == ["lme", "play", str(folder.parent), "1/0", "--step", "7"]
    press(page, "ArrowRight")
    assert page.text_content("#play-here code").endswith("--step 8")


def test_a_page_elsewhere_leaves_open_where_the_run_is(trace, tmp_path, open_page):
    for play, said in (("RUN 1/0", "RUN 1/0"), ("world-1-run-0.mcap", f"{tmp_path}/world-1-run-0.mcap")):
        write_page(trace, tmp_path / "page.html", play=play)
        page = open_page(tmp_path / "page.html")
        assert page.text_content("#play-here code") == f"lme play {said} --step 0"
    write_page(trace, tmp_path / "alone.html")
    assert open_page(tmp_path / "alone.html").is_hidden("#play-here")
