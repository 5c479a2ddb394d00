"""A session's drives: the same as `lme eval` records, and the same again after going back."""

from dataclasses import fields

import numpy as np
import pytest

from lme.errors import InputError
from lme.guides.lme.guide import Lme
from lme.navigation.episode import RunningEpisode
from lme.types import Outcome, Pose
from runners.play.drawing import item_of
from runners.play.session import Source
from runners.play.setups import setup_of
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.workers.episodes import EpisodePayload, initialise
from tests.composing import jobs_of, last_of_each
from tests.runners.play.conftest import drive, ways

LABELS = RunLabels(**dict.fromkeys((field.name for field in fields(RunLabels)), ""))


def recorded(world, run, *words):
    """The trajectory of an episode, as a worker of `lme eval` records it."""
    with jobs_of("eval", "tracking=none") as job:
        config = job(*last_of_each("sim=fast", *words)).config
    return initialise(EpisodePayload(config, LABELS, None))(EpisodeKey(world, run))


@pytest.mark.parametrize(
    "words",
    [
        ["system=lme_plus", "map=barn", "map.worlds=[282]"],
        ["system=lme", "map=barn", "map.worlds=[282]"],
        [
            "system=lme_plus",
            "sim=skid",
            "sim.latency=0.1",
            "map=dynabarn",
            "map.worlds=[3]",
        ],
        [
            "system=dwa_tuned",
            "robot=turtlebot2",
            "sim=physics",
            "sim.scan_noise=0.02",
            "map=real1_dynamic",
            "map.worlds=[1]",
        ],
        ["system=move_base", "map=empty"],
        [
            "system=lme_plus",
            "robot=turtlebot2",
            "map=social",
            "map.kind=doorway",
            "people=tracked",
            "map.worlds=[2]",
        ],
    ],
    ids=lambda words: " ".join(words[:3]),
)
def test_an_episode_that_nobody_touches_equals_its_record_to_the_last_bit(session_of, words):
    session = drive(session_of(*words, run=1))
    (lane,) = session.lanes
    world = session.script.setup.task.number
    record = recorded(world, 1, *words)
    columns = [0, 1, 2, 3, 4, 5, 9]
    assert np.array_equal([frame.row for frame in lane.frames], record.trajectory[:, columns])
    subgoals = [frame.moment.subgoal for frame in lane.frames[:-1]]
    assert np.array_equal(np.reshape(subgoals, (-1, 2)), record.trajectory[:-1, 6:8])
    assert (str(lane.outcome), len(lane.frames) - 1) == (record.record.outcome, record.record.steps)


WALL = item_of("walls", {"points": [[5.0, 2.0], [5.0, 6.0]], "thickness": 0.1})
DISC = item_of("circles", {"centre": [8.0, 4.3], "radius": 0.4})
PERSON = item_of("movers", {"radius": 0.25, "path": [[7.0, 6.0], [7.0, 2.0]], "repeat": "back_and_forth"})


def edited(session):
    """A drive in which something is drawn, dragged and erased, and the goal moves."""
    drive(session, 5)
    session.put(5, "d1", WALL)
    drive(session, 17)
    session.put(17, "d2", DISC)
    session.put(17, "d3", PERSON)
    drive(session, 31)
    session.move_goal(31, (10.0, 6.5))
    drive(session, 44)
    session.erase(44, "d1")
    return drive(session)


@pytest.mark.parametrize(
    "words",
    [
        ["system=lme_plus"],
        ["system=lme", "sim.latency=0.1", "sim.scan_noise=0.02", "sim.goal_noise=0.02", "sim.goal_rate=2"],
        ["system=lme_plus", "sim=skid"],
        ["system=lme", "sim=physics", "sim.slip=0.05"],
        ["system=move_base"],
        ["system=lme,dwa_tuned", "people=tracked"],
    ],
    ids=lambda words: " ".join(words),
)
def test_going_back_and_on_again_gives_the_same_drive(session_of, words):
    session = edited(session_of(*words))
    driven = ways(session)
    for step in (44, 23, 7):
        for lane in session.lanes:
            lane.rewind(step, session.tasks)
        drive(session)
        assert ways(session) == driven
    again = session_of(*words)
    again._stage(session.script)  # from its script alone
    assert ways(drive(again)) == driven


@pytest.mark.parametrize("sim", ["fast", "physics", "skid"])
def test_a_collision_is_the_same_collision_again(session_of, sim):
    session = drive(session_of(f"sim={sim}", "system=simple"), 5)
    session.put(5, "d1", WALL)
    drive(session)
    assert session.lanes[0].outcome is Outcome.COLLISION
    driven = ways(session)
    for step in (session.last - 1, 12, 3):
        session.lanes[0].rewind(step, session.tasks)
        assert ways(drive(session)) == driven


def test_a_drag_counts_as_its_last_place(session_of):
    words = ["system=lme_plus", "sim.scan_noise=0.02"]
    slow, quick = session_of(*words), session_of(*words)
    for session in (slow, quick):
        drive(session, 12)
    for y in (2.0, 2.5, 3.0, 3.5):
        slow.put(12, "d1", item_of("circles", {"centre": [4.0, y], "radius": 0.4}), "drag")
    quick.put(12, "d1", item_of("circles", {"centre": [4.0, 3.5], "radius": 0.4}))
    assert ways(drive(slow)) == ways(drive(quick))
    slow.undo()
    assert not slow.undoable
    assert slow.script.drawings[0].items == {}


def test_undo_and_redo_give_the_drive_before_and_after_a_change(session_of):
    session = session_of()
    before = ways(drive(session, 40))
    session.put(20, "d1", WALL)
    after = ways(drive(session))
    session.undo()
    assert session.shown == 20
    assert ways(drive(session, 40)) == before
    session.redo()
    assert ways(drive(session)) == after


def test_what_is_drawn_is_seen_at_once(session_of):
    session = drive(session_of("robot.lidar.noise_std=0"), 10)
    x = session.lanes[0].frames[10].state.pose.x
    session.put(10, "d1", item_of("circles", {"centre": [x + 2.0, 4.0], "radius": 0.5}))
    frame = session.lanes[0].frames[10]
    assert len(session.lanes[0].frames) == 11
    ahead = frame.moment.observation.scan.ranges[360]
    assert ahead == pytest.approx(1.5 - session.script.setup.systems[0].config.robot.lidar.x, abs=0.01)
    assert frame.moment.explanation is not None


def test_a_goal_that_moves_on_prolongs_a_drive_that_has_ended(session_of):
    session = drive(session_of())
    assert session.lanes[0].outcome is Outcome.SUCCESS
    last = session.last
    session.move_goal(last, (2.0, 6.0))
    assert session.lanes[0].outcome is None
    assert drive(session).lanes[0].outcome is Outcome.SUCCESS
    assert session.last > last


def test_a_robot_that_is_put_elsewhere_begins_anew_there(session_of, says):
    session = drive(session_of(), 10)
    session.move_start(10, Pose(2.0, 2.0, 1.0))
    assert [len(lane.frames) for lane in session.lanes] == [1]
    assert session.lanes[0].frames[0].state.pose == (2.0, 2.0, 1.0)
    same = session.script
    with says.raises(InputError):
        session.move_start(0, Pose(0.0, 2.0, 1.0))
    assert session.script is same
    assert drive(session).lanes[0].outcome is Outcome.SUCCESS


def test_reset_keeps_the_world_and_the_random_numbers(session_of):
    session = edited(session_of("sim.scan_noise=0.02"))
    drawing = session.script.at(session.last)
    session.reset()
    assert session.script.drawings == {0: drawing}
    first = ways(drive(session))
    session.reset()
    assert ways(drive(session)) == first


def test_other_systems_go_on_from_where_the_robot_is(session_of):
    session = drive(session_of(), 25)
    session.put(25, "d1", WALL)
    pose = session.lanes[0].frames[25].state.pose
    session.choose(setup_of(Source(("system=lme",)), former=session.script.setup), 25)
    assert session.lanes[0].frames[0].state.pose == pose
    assert "d1" in session.script.at(0).items
    assert session.lanes[0].label == "LME"
    session.undo()
    assert session.shown == session.last == 25
    session.redo()
    session.reset()
    assert session.lanes[0].frames[0].state.pose == tuple(session.script.at(0).start)


def test_a_decision_that_fails_drives_no_command_twice(session_of, monkeypatch):
    session, whole = session_of(), drive(session_of(), 12)
    drive(session, 8)

    def fail(self):
        raise KeyError("a planner of one's own")

    with monkeypatch.context() as patch:
        patch.setattr(RunningEpisode, "decide", fail)
        for _ in range(3):
            with pytest.raises(KeyError):
                session.advance(12, 10.0)
    drive(session, 12)
    assert [frame.row for frame in session.lanes[0].frames] == [frame.row for frame in whole.lanes[0].frames]


def test_systems_side_by_side_have_the_same_world_and_random_numbers(session_of):
    both = drive(session_of("system=lme,lme_plus", "map=barn", "map.worlds=[282]"))
    alone = [
        drive(session_of(f"system={name}", "map=barn", "map.worlds=[282]")) for name in ("lme", "lme_plus")
    ]
    assert ways(both) == [way for session in alone for way in ways(session)]


def test_a_look_at_a_decision_changes_nothing(session_of):
    session = edited(session_of())
    driven = ways(session)
    (lane,) = session.lanes
    episode = lane.before(23, session.tasks)
    episode.decide()
    assert np.array_equal(episode.navigator.guidance.subgoal, lane.frames[23].moment.guidance.subgoal)
    assert lane.before(session.last, session.tasks) is None
    lane.rewind(50, session.tasks)
    assert ways(drive(session)) == driven


def test_what_cannot_be_copied_is_driven_again(session_of, monkeypatch):
    def refuse(guide, memo):
        raise TypeError("cannot be copied")

    expected = ways(edited(session_of()))
    session = session_of()
    monkeypatch.setattr(Lme, "__deepcopy__", refuse, raising=False)
    assert ways(edited(session)) == expected


@pytest.mark.parametrize(
    "words",
    [
        ["map=barn,empty"],
        ["robot=jackal,stage", "map=empty"],
        ["system=lme,lme_plus,dwa,dwa_tuned,simple"],
    ],
    ids=" ".join,
)
def test_what_cannot_drive_side_by_side_is_refused(words, says):
    with says.raises(InputError):
        setup_of(Source(tuple(words)))
