"""The page in Chromium: drawing, dragging, a whole drive, taking over, saving and driving what was saved."""

import re
import threading

import numpy as np
import pytest

from runners.cli import main
from runners.play.message_handler import MessageHandler
from runners.play.server import OWN, SHARED, own
from runners.reports.explainer.write import asset
from tests.runners.reports.explainer.conftest import browser, settle, until  # noqa: F401 - a fixture

uvicorn = pytest.importorskip("uvicorn", reason="needs uvicorn: the extra play")
pytest.importorskip("starlette", reason="needs starlette: the extra play")

TOKEN = "token"


class Served:
    """A session and its page, opened in a browser."""

    def __init__(self, session, folder, window, **settings):
        from runners.play.run import bound
        from runners.play.server import application

        self.session = session
        config = uvicorn.Config(
            application(MessageHandler(session, folder), TOKEN),
            log_level="error",
            ws="websockets-sansio",
            lifespan="off",
        )
        self._server, self._listener = uvicorn.Server(config), bound(0)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._listener]})
        self._thread.start()
        self.address = f"http://127.0.0.1:{self._listener.getsockname()[1]}/{TOKEN}/"
        self.said = []
        self.page = self.opened(window, **settings)

    def opened(self, window, width=1280, height=800, **settings):
        page = window.new_context(viewport={"width": width, "height": height}, **settings).new_page()
        page.on("console", lambda message: self.said.append(message.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.goto(self.address)
        page.wait_for_selector("body.ready", timeout=20000)
        settle(page)
        return page

    def close(self):
        self.page.context.close()
        self._server.should_exit = True
        self._thread.join()
        self._listener.close()


@pytest.fixture
def serve(session_of, tmp_path, monkeypatch, browser):  # noqa: F811
    monkeypatch.chdir(tmp_path)
    opened = []

    def serving(*words, session=None, **settings):
        opened.append(Served(session or session_of(*words), tmp_path, browser, **settings))
        return opened[-1]

    yield serving
    for served in opened:
        served.close()
        assert served.said == []


def at(page, x, y, lane=0):
    """Where a point of the world is on the window [px]."""
    box = page.locator("canvas.scene").nth(lane).bounding_box()
    px, py = page.evaluate(f"play.views[{lane}].scene.camera.place({x}, {y})")
    return box["x"] + px, box["y"] + py


def drag(page, start, *places):
    """Press at a point of the world, drag over others, release."""
    page.mouse.move(*at(page, *start))
    page.mouse.down()
    for place in places:
        page.mouse.move(*at(page, *place), steps=3)
    page.mouse.up()
    until(page, "!play.sending")
    settle(page)


def forward(page, steps):
    page.evaluate(f"play.forward({steps})")
    settle(page)


def state(page):
    return page.evaluate("({step: play.step, last: play.last, ended: play.ended, parts: play.world.parts})")


def test_no_two_scripts_use_the_same_name():
    """They are one script for the browser, in which a second function of a name replaces the first."""
    texts = [*map(asset, SHARED), *map(own, OWN)]
    names = re.findall(r"^(?:async )?(?:function\*?|class|const|let) (\w+)", "\n".join(texts), re.MULTILINE)
    assert sorted(names) == sorted(set(names))


def test_the_legs_of_a_walking_robot_are_drawn_between_its_steps(serve):
    pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
    pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")
    served = serve("robot=go2", "sim=mujoco")
    forward(served.page, 4)
    third, fourth = (frame.state.legs for frame in served.session.lanes[0].frames[3:5])
    drawn = served.page.evaluate("[...play.views[0].trace.legs(3.25)]")
    np.testing.assert_allclose(np.reshape(drawn, (4, 3, 2)), 0.75 * third + 0.25 * fourth, atol=1e-6)
    # After a step back and a change, they are those of the new drive.
    served.page.evaluate("play.go(2)")
    served.page.evaluate('play.put("d1", "circles", { centre: [9, 9], radius: 0.2 })')
    until(served.page, "!play.sending")
    settle(served.page)
    forward(served.page, 2)
    legs = served.session.lanes[0].frames[4].state.legs
    drawn = served.page.evaluate("[...play.views[0].trace.legs(4)]")
    np.testing.assert_allclose(np.reshape(drawn, (4, 3, 2)), legs, atol=1e-6)


def test_a_robot_on_wheels_has_no_legs(serve):
    assert serve().page.evaluate("[play.views[0].trace.legs(0), 'legs' in play.views[0].trace.arrays]") == [
        None,
        False,
    ]


def test_a_whole_drive(serve):
    served = serve()
    page = served.page
    page.select_option("#speed", "20")
    page.keyboard.press("Space")
    until(page, "play.ended && play.step === play.last && !play.playing")
    assert page.text_content("#choice") == "success"
    assert "success" in page.text_content(".caption")
    assert page.text_content("#results-rows tr td") == "1"
    for _ in range(2):
        page.keyboard.press("ArrowLeft")
    settle(page)
    assert state(page)["step"] == state(page)["last"] - 2
    assert page.text_content("#sentence") == served.session.lanes[0].frames[-3].sentence


def test_what_is_drawn_is_in_the_world(serve):
    served = serve()
    page = served.page
    forward(page, 5)
    page.click("[data-tool=wall]")
    drag(page, (6, 2), (6, 6))
    page.click("[data-tool=disc]")
    drag(page, (8, 2), (8, 2.5))
    page.click("[data-tool=box]")
    drag(page, (3, 1), (4, 2))
    page.click("[data-tool=person]")
    drag(page, (9, 2), (9, 6))
    items = served.session.script.at(5).items
    kinds = [item.kind for item in items.values()]
    assert kinds == ["walls", "circles", "boxes", "movers"]
    wall, disc, box, person = (item.entry for item in items.values())
    assert np.allclose(wall["points"], [[6, 2], [6, 6]], atol=0.05)
    assert np.allclose([*disc["centre"], disc["radius"]], [8, 2, 0.5], atol=0.05)
    assert np.allclose([box["centre"], box["size"]], [[3.5, 1.5], [1, 1]], atol=0.05)
    assert np.allclose(person["path"], [[9, 2], [9, 6]], atol=0.05)
    assert page.evaluate("play.selectedPart.kind") == "movers"
    assert page.is_visible("#selection")


def test_things_are_dragged_turned_and_erased_and_it_can_be_undone(serve):
    served = serve()
    page, session = served.page, served.session
    page.click("[data-tool=box]")
    drag(page, (4, 2), (5, 2.5))
    page.click("[data-tool=move]")
    drag(page, (4.5, 2.25), (5.5, 5.25))
    (box,) = session.script.at(0).items.values()
    assert np.allclose(box.entry["centre"], [5.5, 5.25], atol=0.05)
    page.keyboard.press("[")
    until(page, "play.selectedPart?.entry.yaw_deg === 15")
    page.fill("#selected-fields input >> nth=4", "40")
    page.keyboard.press("Enter")
    until(page, "play.selectedPart?.entry.yaw_deg === 40")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Delete")
    until(page, "play.world.parts.length === 4")
    for expected in (40, 15, 0):
        page.keyboard.press("Control+z")
        until(page, f"play.world.parts.at(-1).entry.yaw_deg === {expected}")
    page.keyboard.press("Control+Shift+Z")
    until(page, "play.world.parts.at(-1).entry.yaw_deg === 15")


def test_the_goal_and_the_robot_can_be_dragged_while_it_drives(serve):
    served = serve()
    page, session = served.page, served.session
    page.keyboard.press("Space")
    until(page, "play.step > 8")
    drag(page, (10.5, 4.0), (9.0, 6.0))
    assert page.evaluate("play.playing")
    assert np.allclose(session.script.at(session.last).goal, [9.0, 6.0], atol=0.05)
    until(page, "play.step > 14")
    assert len(session.script.drawings) > 1
    page.keyboard.press("Space")
    pose = page.evaluate("play.views[0].shownPose")
    drag(page, (pose["x"], pose["y"]), (2.0, 2.0))
    assert np.allclose(session.script.at(0).start[:2], [2.0, 2.0], atol=0.06)
    assert state(page)["step"] == 0
    assert page.evaluate("play.views[0].ghosts.length") > 0


def test_a_candidate_that_is_pointed_at_is_let_go_when_others_are_drawn(serve):
    page = serve().page
    for steps in (10, 30):
        forward(page, steps)
        box = page.locator("canvas.scene").bounding_box()
        inside = f"([x, y]) => x > 9 && x < {box['width'] - 9} && y > 99 && y < {box['height'] - 9}"
        x, y = page.evaluate(f"play.views[0].scene.spots.findLast({inside})")
        page.mouse.move(box["x"] + x, box["y"] + y)
        until(page, f"play.views[0].pointed === play.views[0].scene.candidateAt({x}, {y}, 9)")
        settle(page)
        assert page.text_content("#candidate").startswith("Candidate")
    drag(page, (10.5, 4.0), (9.5, 6.0), (3.0, 1.0))
    page.mouse.move(0, 0)
    forward(page, 5)
    assert page.text_content("#candidate").startswith("The best candidate")


def test_everything_can_be_done_by_keyboard(serve):
    served = serve("system=lme,lme_plus")  # so narrow that the world is shown turned
    page, session = served.page, served.session
    page.keyboard.press("3")
    page.keyboard.press("i")
    until(page, "play.selectedPart?.kind === 'boxes'")
    before = page.evaluate("play.views[0].scene.camera.place(...play.selectedPart.entry.centre)")
    page.keyboard.press("ArrowRight")
    until(page, f"play.views[0].scene.camera.place(...play.selectedPart.entry.centre)[0] > {before[0]} + 1")
    now = page.evaluate("play.views[0].scene.camera.place(...play.selectedPart.entry.centre)")
    assert now[1] == pytest.approx(before[1], abs=0.5)
    page.keyboard.press("Escape")
    for _ in range(2):
        page.keyboard.press("t")
    assert page.evaluate("play.selected") == "goal"
    page.keyboard.press("ArrowLeft")
    until(page, "!play.sending")
    assert np.hypot(*np.subtract(session.script.at(0).goal, (10.5, 4.0))) == pytest.approx(0.1)
    page.keyboard.press("Escape")
    page.keyboard.press("ArrowRight")
    until(page, "play.step === 1")
    page.keyboard.press("r")
    until(page, "play.step === 0")
    page.keyboard.press("?")
    assert page.is_visible("#help")
    page.keyboard.press("Escape")
    until(page, "document.getElementById('spoken').textContent.startsWith('Step 0')")


def test_two_systems_drive_side_by_side(serve):
    served = serve("system=lme,lme_plus", "map=barn", "map.worlds=[282]")
    page = served.page
    forward(page, 20)
    captions = page.locator(".caption").all_text_contents()
    assert [caption.split(" · ")[0] for caption in captions] == ["LME", "LME+"]
    page.mouse.click(*at(page, 0, 0, lane=1))
    settle(page)
    assert page.text_content("#sentence").startswith("LME+: ")
    page.select_option("#set-beside", "dwa")
    until(page, "play.views.length === 2 && play.views[1].trace.head.system.startsWith('DWA')")
    page.select_option("#set-beside", "")
    until(page, "play.views.length === 1")


def test_values_change_without_a_restart(serve):
    served = serve()
    page, session = served.page, served.session
    forward(page, 20)
    pose = session.lanes[0].frames[20].state.pose
    page.click("summary >> nth=0")
    page.fill("[id='set-sim.latency']", "0.1")
    page.keyboard.press("Enter")
    until(page, "play.situation.values['sim.latency'] === 0.1")
    assert session.lanes[0].frames[0].state.pose == pose
    page.select_option("#set-system", "lme")
    until(page, "play.situation.lanes[0].system === 'LME'")
    page.select_option("#set-map", "barn")
    until(page, "play.situation.map === 'barn'")
    page.fill("#set-world", "282")
    page.keyboard.press("Enter")
    until(page, "play.situation.world === 282")
    page.fill("#set-world", "7777")
    page.keyboard.press("Enter")
    until(page, "!document.getElementById('notice').hidden")
    assert "7777" in page.text_content("#notice")
    assert session.script.setup.task.number == 282


def test_what_was_drawn_is_saved_and_driven_by_eval(serve, tmp_path):
    served = serve()
    page = served.page
    page.click("[data-tool=wall]")
    drag(page, (6, 2), (6, 6))
    page.fill("#save-name", "mine")
    page.click("#save button")
    until(page, "document.querySelector('#saved code') !== null")
    path, command = page.locator("#saved code").all_text_contents()
    assert path == "outputs/play/mine.yaml"
    system = ["system=lme_plus", "runs=1", "executor=serial", "tracking=none", "hydra.run.dir=run"]
    assert main.main([*command.split()[1:], *system]) == 0
    from runners.records.records import read_trajectories

    forward(page, 1000)
    until(page, "play.ended")
    driven = read_trajectories([tmp_path / "run"])[["x_m", "y_m", "yaw_rad"]].to_numpy()
    assert np.array_equal(driven, [frame.row[1:4] for frame in served.session.lanes[0].frames])


def test_an_episode_is_taken_over(serve, tmp_path):
    from runners.play.opening import open_episode

    words = ["robot=turtlebot2", "map=traps", "map.worlds=[1]", "system=dwa", "map.time_limit=20", "runs=1"]
    assert main.main(["eval", *words, "executor=serial", "tracking=none", "hydra.run.dir=run"]) == 0
    session = open_episode(tmp_path / "run", "1/0", None)
    frames = len(session.lanes[0].frames)
    served = serve(session=session)
    page = served.page
    assert state(page)["step"] == session.shown > 0
    until(page, f"play.last === {frames - 1}")
    page.select_option("#set-system", "lme_plus")
    until(page, "play.situation.lanes[0].system === 'LME+'")
    forward(page, 2000)
    until(page, "play.ended")
    assert page.text_content("#choice") == "success"


def test_nothing_is_computed_while_the_page_rests_or_is_closed(serve):
    served = serve()
    page = served.page
    forward(page, 3)
    last = served.session.last
    page.wait_for_timeout(600)
    assert served.session.last == last
    page.keyboard.press("Space")
    page.wait_for_timeout(300)
    page.goto("about:blank")
    page.wait_for_timeout(300)
    last = served.session.last
    page.wait_for_timeout(600)
    assert served.session.last == last
    page.goto(served.address)
    page.wait_for_selector("body.ready")
    until(page, f"play.last === {last}")


def test_a_second_page_takes_the_session_over(serve, browser):  # noqa: F811
    served = serve()
    forward(served.page, 4)
    other = served.opened(browser)
    until(served.page, "!document.getElementById('notice').hidden")
    assert "another page" in served.page.text_content("#notice")
    until(other, "play.last >= 4")
    other.context.close()


@pytest.mark.parametrize(
    "layer", ["memory", "times", "arcs", "truth", "seen", "scan", "sectors", "candidates", "ghosts"]
)
def test_every_layer_changes_the_picture(serve, layer):
    served = serve("map=barn", "map.worlds=[282]", "system=lme_plus")
    page = served.page
    forward(page, 25)
    if layer == "ghosts":
        page.keyboard.press("r")
        until(page, "play.step === 0 && play.last === 0")
        forward(page, 3)
    if layer == "scan":
        page.evaluate("document.getElementById('layer-sectors').click()")
    settle(page)
    picture = "play.views[0].canvas.toDataURL()"
    before = page.evaluate(picture)
    page.evaluate(f"document.getElementById('layer-{layer}').click()")
    page.wait_for_timeout(400)
    settle(page)
    assert page.evaluate(picture) != before
    page.evaluate(f"document.getElementById('layer-{layer}').click()")
    settle(page)
    page.wait_for_timeout(200)
    assert page.evaluate(picture) == before


@pytest.mark.parametrize(("width", "height"), [(1200, 800), (1600, 900), (820, 1180)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits(serve, width, height, scheme):
    served = serve("system=lme,lme_plus", width=width, height=height, color_scheme=scheme)
    wide = served.page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width
    boxes = served.page.locator("canvas.scene")
    assert all(boxes.nth(i).bounding_box()["height"] > 250 for i in range(2))
