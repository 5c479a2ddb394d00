"""Recorded people: the reader, where they are when, and what is wrong with a file. `square.txt` is made with lme."""

from pathlib import Path

import numpy as np
import pytest

from lme.config.presets import load_map_set, load_robot
from lme.errors import InputError
from lme.simulation.crowd import Crowd
from lme.types import Pose
from lme.worlds.check import check_task

SQUARE = Path(__file__).parent / "square.txt"
ROBOT = load_robot("jackal")
FAR = Pose(1e3, 0.0, 0.0)
TWO = "0 7 0 0\n10 7 1 0\n20 7 2 0\n10 8 0 5\n50 8 4 5\n"  # .4 s between ten frames


def tracks(path=SQUARE, **settings):
    return load_map_set("tracks", {"path": str(path), **settings}, ROBOT)


@pytest.fixture
def written(tmp_path):
    def write(text, name="some.txt"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return write


def places(task, time):
    crowd = Crowd(task.world.movers)
    for _ in range(round(time / 0.05)):
        crowd.advance(FAR, 0.05)
    return crowd.circles[:, :2]


def test_people_are_where_they_were(written):
    task = tracks(written(TWO), start=[0, 2], goal=[4, 2]).task(0)
    assert places(task, 0.2) == pytest.approx(np.array([[0.5, 0.0]]))
    assert places(task, 0.6) == pytest.approx(np.array([[1.5, 0.0], [0.5, 5.0]]))
    assert places(task, 1.2) == pytest.approx(np.array([[2.0, 5.0]]))
    assert len(places(task, 2.5)) == 0


def test_a_later_world_is_the_same_recording_from_later_on(written):
    path = written(TWO)
    first, later = (tracks(path, start=[0, 2], goal=[4, 2], every=0.6).task(number) for number in (0, 1))
    assert places(later, 0.3) == pytest.approx(places(first, 0.9))
    assert later.measures["people"] == 2


def test_every_line_of_the_recording_is_met():
    task = tracks(start=[-3.0, 3.0], goal=[13.0, 3.0]).task(0)
    crowd, rows = Crowd(task.world.movers), np.loadtxt(SQUARE)
    for frame in np.unique(rows[:, 0]):
        there = rows[rows[:, 0] == frame][:, 2:]
        ends = [time for mover in task.world.movers for time in mover.times[[0, -1]]]
        now = (frame - rows[0, 0]) / 25.0
        if not np.isclose(ends, now).any():  # at the first and last time someone may be in or out
            ours = crowd.circles[:, :2].round(6)
            assert ours[np.lexsort(ours.T)] == pytest.approx(there[np.lexsort(there.T)], abs=1e-6)
        for _ in range(4):
            crowd.advance(FAR, 0.1)


def test_commas_and_comments_are_read_as_well(written):
    plain, other = tracks(written(TWO)), tracks(written("# made\n" + TWO.replace(" ", ", "), "other.csv"))
    assert [m.path.tolist() for m in plain.task(0).world.movers] == [
        m.path.tolist() for m in other.task(0).world.movers
    ]
    assert (plain.name, other.name) == ("some", "other")


def test_a_long_gap_makes_two_people(written):
    lines = "0 1 0 0\n10 1 1 0\n200 1 5 5\n210 1 6 5\n"
    assert len(tracks(written(lines), start=[0, 3], goal=[6, 3]).task(0).world.movers) == 2


def test_the_robot_crosses_the_recorded_area_and_starts_where_nobody_stands():
    maps = tracks(every=4.0)
    rows = np.loadtxt(SQUARE)
    for number in maps.numbers:
        task = maps.task(number)
        check_task(task, ROBOT)
        assert task.start.x == pytest.approx(rows[:, 2].min())
        assert task.goal[0] == pytest.approx(rows[:, 2].max())
        assert task.start.y == pytest.approx((rows[:, 3].min() + rows[:, 3].max()) / 2)
        there = places(task, 0.0)
        assert not len(there) or np.hypot(*(there - task.start[:2]).T).min() > 1.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "0 1 0 0\n",
        "0 1 0\n",
        "0 1 0 0\n10 1 nan 0\n",
        "0 1 2 0 4 .1 0 .1\n",
        "0 1 0 0\n0 1 1 0\n",
        "frame,id,x,y\n0,1,0,0\n",
    ],
)
def test_a_wrong_file_is_named_with_its_line(written, text, says):
    with says.raises(InputError):
        tracks(written(text))


@pytest.mark.parametrize(
    "settings",
    [
        {"path": None},
        {"path": "nowhere.txt"},
        {"frame_rate": 0.0},
        {"start": [1.0]},
        {"worlds": [999]},
    ],
    ids=str,
)
def test_a_wrong_setting_is_named(settings, says):
    with says.raises(InputError):
        tracks(**{"path": SQUARE, **settings}) if "path" not in settings else load_map_set(
            "tracks", settings, ROBOT
        )


def walk(step=10, people=2, speed=1.3, frame_rate=25.0, unit=1.0):
    """People who walk along x, in the unit [m] of the file; frames are `step` apart."""
    lines = []
    for person in range(people):
        for k in range(20):
            x = speed * k * step / frame_rate / unit
            lines.append(f"{k * step} {person} {x:.6f} {person * 2.0 / unit:.6f}\n")
    return "".join(lines)


@pytest.mark.parametrize(
    "text",
    [
        walk(step=6, frame_rate=15.0),  # ETH
        walk(step=1, frame_rate=2.5),  # annotated frames are counted
        walk(frame_rate=30.0, unit=0.02),
        walk(unit=0.01),
        walk(unit=0.001),
    ],
    ids=["15 Hz", "2.5 Hz", "0.02 m", "0.01 m", "0.001 m"],
)
def test_other_units_are_noticed_by_the_speed_of_walking(written, text, says):
    with pytest.warns(UserWarning, match="m/s") as caught:
        tracks(written(text), start=[-5.0, 0.0], goal=[50.0, 0.0])
    says(caught[0].message)


@pytest.mark.parametrize("text", [walk(), walk(speed=1.9), walk(speed=0.0), walk(speed=0.01)])
def test_people_who_walk_or_stand_are_taken_as_they_are(written, text, recwarn):
    tracks(written(text), start=[-5.0, 0.0], goal=[50.0, 0.0])
    assert not recwarn.list


def test_milliseconds_for_frames_are_named_with_the_rate(written, says):
    with says.raises(InputError):
        tracks(written(walk(step=400, frame_rate=1000.0)))


def test_a_recording_of_years_is_refused_before_its_beginnings_are_listed(written, says):
    with says.raises(InputError):
        tracks(written("0 1 0 0\n25 1 1 0\n1e9 2 0 0\n1000000025 2 1 0\n"))
