"""Messages of the page, and what they lead to; a bad one is an error and loses nothing."""

import contextlib
import json
import math
import struct

import numpy as np
import pytest

from lme.navigation.episode import RunningEpisode
from runners.play.message_handler import MessageHandler
from runners.play.page_input import LONGEST_MESSAGE
from tests.runners.play.conftest import drive, ways


@pytest.fixture
def handler(session_of, tmp_path):
    made = MessageHandler(session_of(), tmp_path)
    list(made.welcome())
    return made


def replies(handler, kind, /, **fields):
    return [read(reply) for reply in handler.answer(json.dumps({"type": kind, **fields}))]


def read(reply):
    """The header of a reply, also of a binary one."""
    if isinstance(reply, str):
        return json.loads(reply)
    (length,) = struct.unpack("<I", reply[:4])
    return json.loads(reply[4 : 4 + length])


def of(kind, found):
    return [reply for reply in found if reply["type"] == kind]


def test_a_page_is_told_everything_when_it_comes(session_of, tmp_path):
    handler = MessageHandler(drive(session_of("system=lme,lme_plus"), 20), tmp_path)
    for _ in range(2):  # also when it comes again
        found = [read(reply) for reply in handler.welcome()]
        (options,), (situation,), (world,) = (of(kind, found) for kind in ("options", "situation", "world"))
        assert {"lme_plus", "dwa"} <= options["system"].keys()
        assert "barn" in options["map"]
        assert [lane["system"] for lane in situation["lanes"]] == ["LME", "LME+"]
        assert (situation["kept"], world["step"], len(world["parts"])) == (0, 0, 4)
        frames = of("frames", found)
        assert [(each["lane"], each["from"], each["count"]) for each in frames] == [(0, 0, 21), (1, 0, 21)]
        assert all(len(each["sentences"]) == each["count"] == len(each["decision_us"]) for each in frames)


def test_frames_are_sent_once_and_again_after_a_change(handler):
    (frames, done) = replies(handler, "advance", until=12, ticket=7)
    assert (frames["from"], done) == (1, {"type": "done", "ticket": 7})
    while handler.session.last < 12:
        replies(handler, "advance", until=12)
    found = replies(
        handler, "put", step=5, name="d1", kind="circles", entry={"centre": [6, 4], "radius": 0.3}
    )
    assert of("situation", found)[0]["kept"] == 5
    assert of("world", found)[0]["step"] == 5
    assert [(each["from"], each["count"]) for each in of("frames", found)] == [(5, 1)]
    assert replies(handler, "advance", until=5) == []


def test_nothing_is_computed_that_was_not_asked_for(handler):
    before = handler.session.last
    replies(handler, "detail", lane=0, step=0, layers=["memory"])
    assert handler.session.last == before == 0


DISC = '{"type": "put", "step": 0, "name": "d1", "kind": "circles", "entry": {"centre": %s, "radius": %s}}'


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "not JSON"),
        ("[1]", "not a JSON object"),
        ('{"type": "quit"}', "type is 'quit'"),
        ('{"type": "advance"}', "until is None"),
        ('{"type": "advance", "until": -1}', "until is -1"),
        ('{"type": "advance", "until": 1e9}', "until is 1000000000.0"),
        ('{"type": "advance", "until": NaN}', "not JSON"),
        ('{"type": "put", "step": 0, "name": "d1", "kind": "lava", "entry": {}}', "kind is 'lava'"),
        ('{"type": "put", "step": 0, "name": "d1", "kind": "circles", "entry": {"centre": [1]}}', "radius is missing"),
        (DISC % ("[1, 2]", "-1"), "radius"),
        (DISC % ("[9e9, 2]", "1"), "bounds"),
        ('{"type": "put", "step": 0, "name": "d1", "kind": "movers", "entry": {"path": []}}', "path"),
        ('{"type": "erase", "step": 0, "name": "d9"}', "d9: there is nothing"),
        ('{"type": "goal", "step": 0, "goal": [1, "2"]}', "goal is"),
        ('{"type": "goal", "step": 0, "goal": [1, 1e7]}', "goal is"),
        ('{"type": "start", "step": 0, "start": [0, 0, 0]}', "in collision at the start"),
        ('{"type": "undo"}', "no change"),
        ('{"type": "detail", "lane": 1, "step": 0}', "lane is 1"),
        ('{"type": "save", "step": 0, "kind": "map", "name": "../x"}', "name is"),
        ('{"type": "save", "step": 0, "kind": "exe", "name": "x"}', "kind is"),
        ('{"type": "words", "step": 0, "set": {"system": "lem"}}', "lem"),
        ('{"type": "words", "step": 0, "set": {"robot.v_max": "-1"}}', "robot.v_max"),
        ('{"type": "words", "step": 0, "set": {"planner._target_": "os.system"}}', "cannot be changed"),
        ('{"type": "words", "step": 0, "set": {"hydra.run.dir": "x"}}', "cannot be changed"),
        ('{"type": "words", "step": 0, "set": {"weights": "${oc.env:HOME}"}}', "must be names and numbers"),
        ('{"type": "words", "step": 0, "set": {"weights": "/etc/passwd"}}', "must be in"),
        ('{"type": "words", "step": 0, "set": {"map": "file", "map.path": "../../x.yaml"}}', "must be in"),
        ('{"type": "words", "step": 0, "set": {"weights": ".."}}', "must be in"),
        ('{"type": "words", "step": 0, "set": {"map": "building", "map.paths": "[../x.yaml]"}}', "must be names"),
        ('{"type": "words", "step": 0, "set": {"map": {"a": 1}}}', "must be text or a number"),
        ('{"type": "words", "step": 0, "set": {"planner": "{_target_: os.system}"}}', "must be names and numbers"),
        ('{"type": "words", "step": 0, "set": {"guide.criteria.mine": "os.system"}}', "must be names and numbers"),
        ('{"type": "words", "step": 0, "set": {"run": "-5"}}', "run is -5"),
        ('{"type": "words", "step": 0, "set": {"seed": "-5"}}', "seed is -5"),
        ('{"type": "words", "step": 0, "set": {"robot.v_max": "1,1.1,1.2,1.3,1.4"}}', "5 systems: must be at most 4"),
        ('{"type": []}', "type is []"),
        ('{"type": "save", "step": 0, "kind": [], "name": "x"}', "kind is []"),
        ('{"type": "detail", "lane": 0, "step": 0, "layers": 5}', "layers is 5"),
        ('{"type": "goal", "step": 0, "goal": [1, 1%s]}' % ("0" * 400), "goal is"),
    ],
)  # fmt: skip
def test_a_bad_message_is_an_error_and_loses_nothing(handler, text, problem):
    script, way = handler.session.script, ways(handler.session)
    (error,) = [read(reply) for reply in handler.answer(text)]
    assert error["type"] == "error"
    assert problem in error["text"]
    assert (handler.session.script, ways(handler.session)) == (script, way)


def put(kind, entry):
    return f'{{"type": "put", "step": 0, "name": "d1", "kind": "{kind}", "entry": {entry}}}'


def words(key, value):
    return f'{{"type": "words", "step": 0, "set": {{"{key}": {value}}}}}'


def nested(depth):
    return "[" * depth + "1" + "]" * depth


MANY = json.dumps([[math.cos(i / 200), math.sin(i / 200)] for i in range(1200)])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (words("robot.control_rate", '"1e-9"'), "robot.control_rate is 1e-09: lme play takes 1 to 200"),
        (words("robot.control_rate", "1e-9"), "robot.control_rate is 1e-09"),
        (words("robot.control_rate", '"nan"'), "robot.control_rate"),
        (words("robot.lidar.num_beams", '"1_000_000"'), "robot.lidar.num_beams is 1e+06"),
        (words("robot.v_max", '"inf"'), "robot.v_max is inf"),
        (words("robot.v_max", "1e308"), "robot.v_max is 1e+308"),
        (words("robot.lidar.num_beams", "1000000000"), "robot.lidar.num_beams is 1e+09"),
        (words("sim.latency", '"1e7,0.1"'), "sim.latency is 1e+07"),
        (put("polygons", f'{{"points": {MANY}}}'), "1200 points"),
        (put("walls", '{"points": [[1, 2], [1e308, NaN]]}'), "not JSON"),
        (put("walls", '{"points": [[1, 2], [[3], {}]]}'), "points"),
        (put("walls", f'{{"points": {nested(900)}}}'), "points"),
        (put("movers", '{"path": [[1, 2]], "speed": 1e400}'), "speed"),
        (f'{{"type": "goal", "step": 0, "goal": {nested(50_000)}}}', "not JSON"),
        ('{"type": "goal", "step": 20001, "goal": [1, 1]}', "step is 20001"),
    ],
)
def test_a_hostile_value_is_one_line_and_the_drive_goes_on(handler, text, problem):
    script, way = handler.session.script, ways(handler.session)
    (error,) = [read(reply) for reply in handler.answer(text)]
    assert error["type"] == "error"
    assert problem in error["text"]
    assert "\n" not in error["text"]
    assert (handler.session.script, ways(handler.session)) == (script, way)
    assert of("frames", replies(handler, "advance", until=2))


@pytest.mark.parametrize("kind", ["put", "words", "start", "reset", "clear"])
def test_a_change_that_cannot_be_driven_leaves_the_session_as_it_was(handler, monkeypatch, kind):
    """Whatever fails, and also if it is no mistake of the user."""

    def fail(self):
        raise MemoryError("no 7 GiB")

    expected = ways(drive(MessageHandler(handler.session, handler._root).session, 20))
    before = handler.session.state()
    message = {
        "put": {"step": 9, "name": "d1", "kind": "circles", "entry": {"centre": [6, 4], "radius": 0.3}},
        "words": {"step": 9, "set": {"robot.v_max": 0.7}},
        "start": {"step": 9, "start": [2.0, 4.0, 0.0]},
        "reset": {},
        "clear": {"step": 9},
    }[kind]
    list(handler._changes())
    with monkeypatch.context() as patch:
        patch.setattr(RunningEpisode, "decide", fail)
        (error,) = replies(handler, kind, **message)
    assert error["type"] == "error"
    assert error["text"].endswith("MemoryError: no 7 GiB")
    assert ways(handler.session) == expected
    assert {**handler.session.state(), **before} == handler.session.state()
    drive(handler.session, 40)
    assert ways(handler.session)[0][:21] == expected[0]


def test_what_cannot_be_sent_is_taken_back(handler, monkeypatch):
    def fail(*_):
        raise ValueError("not a number")

    script = handler.session.script
    with monkeypatch.context() as patch:
        patch.setattr("runners.play.message_handler.world_message", fail)
        patch.setattr(handler, "_situation", handler._situation)
        with contextlib.suppress(ValueError):
            replies(handler, "goal", step=0, goal=[2.0, 2.0])
    assert handler.session.script is script
    assert of("situation", replies(handler, "goal", step=0, goal=[2.0, 2.0]))


def test_a_drawing_has_limits(handler, says):
    line = [[x / 100, 1.0] for x in range(900)]
    found = [
        replies(handler, "put", step=0, name=f"d{i}", kind="walls", entry={"points": line}) for i in range(6)
    ]
    assert [bool(of("error", each)) for each in found] == [False] * 5 + [True]
    says(of("error", found[-1])[0]["text"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("guide.reach", 1e5, ""),
        ("sim.max_step", 1e-9, "must be at least 1e-06 m"),
        ("guide.margin", 0.1, None),
    ],
)
def test_numbers_that_the_page_has_no_slider_for_are_tried_first(handler, key, value, problem):
    script = handler.session.script
    errors = of("error", replies(handler, "words", step=0, set={key: value}))
    assert bool(errors) == (problem is not None)
    assert (handler.session.script is script) == bool(errors)
    assert all(problem in error["text"] for error in errors)


def test_a_message_that_is_too_long_is_not_read(handler, says):
    (error,) = [read(reply) for reply in handler.answer(" " * (LONGEST_MESSAGE + 1))]
    says(error["text"])


def test_words_change_what_drives(handler):
    replies(handler, "put", step=0, name="d1", kind="circles", entry={"centre": [6, 4], "radius": 0.3})
    found = of("situation", replies(handler, "words", step=0, set={"system": "lme,dwa", "sim.latency": 0.1}))[
        0
    ]
    assert [lane["system"] for lane in found["lanes"]] == ["LME", "DWA (textbook)"]
    assert (found["words"], found["values"]["sim.latency"]) == (["system=lme,dwa", "sim.latency=0.1"], 0.1)
    assert "d1" in handler.session.script.at(0).items
    found = of("situation", replies(handler, "words", step=0, set={"sim": "skid", "robot": "jackal_real"}))[0]
    assert found["words"] == ["system=lme,dwa", "sim=skid", "robot=jackal_real"]
    found = of("situation", replies(handler, "words", step=0, set={"map": "barn", "map.worlds": "[282]"}))[0]
    assert (found["map"], found["world"]) == ("barn", 282)
    assert handler.session.script.at(0).items == {}
    assert of("situation", replies(handler, "undo"))[0]["map"] == "empty"


def test_a_map_of_the_folder_can_be_opened(handler, tmp_path):
    (tmp_path / "mine.yaml").write_text("bounds: [0, 0, 6, 6]\nstart: [1, 1, 0.5]\ngoal: [5, 5]\n")
    (tmp_path / "other.yaml").write_text("seed: 3\n")
    assert of("options", [read(reply) for reply in handler.welcome()])[0]["files"] == ["mine.yaml"]
    found = replies(handler, "words", step=0, set={"map": "file", "map.path": "mine.yaml"})
    assert of("situation", found)[0]["map"] == "mine"
    assert of("world", found)[0]["start"] == [1, 1, 0.5]


def test_what_a_decision_was_made_of_is_told_when_it_is_asked_for(handler):
    drive(handler.session, 15)
    (detail,) = of(
        "detail", replies(handler, "detail", lane=0, step=11, layers=["memory", "times", "arcs", "x"])
    )
    assert {"memory", "times", "arcs", "costs"} == detail["arrays"].keys()
    assert detail["layers"] == ["memory", "times", "arcs"]
    assert detail["arrays"]["times"][2] == detail["grid"][3] ** 2
    assert detail["arrays"]["arcs"][2] == 2 * detail["arrays"]["costs"][2]


def test_the_arcs_are_those_that_the_planner_chose_from(session_of):
    for words in (
        ["system=lme_plus"],
        ["system=lme_dwa"],
        ["system=lme_plus", "planner.latency=0.1", "sim.latency=0.1"],
    ):
        session = drive(session_of(*words, "map=barn", "map.worlds=[282]"), 30)
        (lane,) = session.lanes
        for step in (3, 12, 25):
            moment = lane.frames[step].moment
            weighed = lane.before(step, session.tasks).navigator.planner.weighed(
                moment.observation, moment.guidance
            )
            best = weighed.commands[np.argmin(weighed.costs)]
            assert best == pytest.approx(moment.command, abs=1e-9)


def test_saving_says_where_it_is_and_how_it_is_used(handler, tmp_path):
    (saved,) = of("saved", replies(handler, "save", step=0, kind="map", name="mine"))
    assert (tmp_path / saved["path"]).is_file()
    assert saved["command"].startswith("lme eval map=file map.path=outputs/play/mine.yaml")
