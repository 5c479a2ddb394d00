"""A film of several systems: the same moment in every panel, the end kept, no larger and no longer than asked."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import to_world
from runners.cli.main import main
from runners.config.catalogue import shipped
from runners.config.instantiate import build
from runners.reports.figures import animation
from runners.reports.figures.animation import Screen
from runners.reports.figures.driven_runs import read_runs
from runners.reports.figures.scene import outline
from runners.reports.figures.stage import TRAIL_S, Stage, draw_mover_trails, index_at, seen
from runners.reports.figures.style import new_figure
from runners.reports.figures.video import Video

WORDS = ["map=real1_dynamic", "robot=turtlebot2", "runs=1", "executor=serial"]


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """LME, which is stopped by a short time limit, and DWA."""
    folder = tmp_path_factory.mktemp("film")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = ["-m", "system=lme,dwa", "map.time_limit=10", "world=0", "hydra.sweep.dir=out"]
        assert main(["figure", "video", *words, "figure.width=400", "figure.fps=5", *WORDS]) == 0
    return folder / "out"


@pytest.fixture(scope="module")
def traces(sweep):
    return [job.trace(0, 0) for job in read_runs([sweep])]


def durations(path):
    with Image.open(path) as pictures:
        return [_duration(pictures, number) for number in range(pictures.n_frames)]


def _duration(pictures, number):
    pictures.seek(number)
    return pictures.info["duration"]


def test_the_command_films_all_systems_at_their_own_pace(sweep, traces):
    path = sweep / "video.gif"
    seconds = sum(durations(path)) / 1000
    assert seconds == pytest.approx(
        max(trace.end.time for trace in traces) + 1.0, abs=0.4
    )  # the end stays 1 s
    with Image.open(path) as pictures:
        assert pictures.width <= 400


def test_flat_colours_are_those_of_the_figure(sweep):
    with Image.open(sweep / "video.gif") as pictures:
        pictures.seek(20)
        colours = {colour for _, colour in pictures.convert("RGB").getcolors(1 << 20)}
    assert {(255, 255, 255), (0x9A, 0x9A, 0x9A), (0x00, 0x72, 0xB2)} <= colours


def test_speed_is_in_times_real_time(sweep, tmp_path, traces):
    (path,) = Video(load_settings("figure/video", speed=2.0, width=200, fps=4)).draw(
        read_runs([sweep]), [0], tmp_path / "v", []
    )
    last = max(trace.end.time for trace in traces)
    assert sum(durations(path)) / 1000 == pytest.approx(last / 2.0 + 1.0, abs=0.5)


def test_a_long_episode_is_shown_in_twenty_seconds_unless_asked_otherwise(sweep, tmp_path, monkeypatch):
    monkeypatch.setattr("runners.reports.figures.video.ENOUGH_S", 5.0)
    (path,) = Video(load_settings("figure/video", width=200, fps=4)).draw(
        read_runs([sweep]), [], tmp_path / "v", []
    )
    assert sum(durations(path)) / 1000 == pytest.approx(6.0, abs=0.5)


def test_a_film_is_the_same_twice(sweep, tmp_path):
    for name in ("one", "two"):
        Video(load_settings("figure/video", speed=4.0, width=200, fps=4)).draw(
            read_runs([sweep]), [0], tmp_path / name, []
        )
    assert (tmp_path / "one.gif").read_bytes() == (tmp_path / "two.gif").read_bytes()


def test_only_moving_parts_are_redrawn(traces):
    screen = Screen(traces, ["LME", "DWA"], 400)
    first, later = screen.at(0.0), screen.at(5.0)
    changed = (first != later).any(axis=2)
    assert 0 < changed.mean() < 0.1
    np.testing.assert_array_equal(screen.at(0.0), first)  # nothing of the later picture is left


def test_an_ended_episode_stays_as_it_ended(traces):
    screen = Screen(traces[:1], ["LME"], 300)
    end = traces[0].end.time
    np.testing.assert_array_equal(screen.at(end), screen.at(end + 50.0))
    assert (screen.at(end) != screen.at(end - 0.2)).any()


def test_candidates_are_shown_where_asked(traces):
    plain, with_them = (Screen(traces[:1], [""], 300, candidates=each).at(2.0) for each in (False, True))
    assert (plain != with_them).any(axis=2).sum() > 300


def test_a_moment_is_the_last_decision_before_it(traces):
    times = [frame.time for frame in traces[0].frames]
    assert [index_at(traces[0], time) for time in times] == list(range(len(times)))
    assert index_at(traces[0], times[3] + 0.1) == 3
    assert index_at(traces[0], 1e9) == len(times) - 1
    assert index_at(traces[0], -1.0) == 0


def test_the_robot_its_beams_and_its_subgoal_stand_where_they_were(traces):
    trace, index = traces[0], 20
    stage = Stage(new_figure(3, 3).add_subplot(), trace, beams=True)
    stage.show(index)
    step = trace.steps[index]
    corners = to_world(outline(trace.robot.footprint), step.pose)
    np.testing.assert_allclose(stage._robot.get_xy()[: len(corners)], corners)
    np.testing.assert_allclose(np.ravel(stage._subgoal.get_data()), step.subgoal)
    beams = np.array(stage._beams.get_segments())
    hits = seen(step, trace.robot)
    assert 90 < len(beams) <= 180
    assert all(np.abs(hits - end).sum(axis=1).min() < 1e-12 for end in beams[:, 1])
    np.testing.assert_allclose(beams[:, 0], np.tile(step.pose[:2], (len(beams), 1)))  # mounted in the middle


def test_movers_leave_rings_where_they_were(traces):
    trace = traces[0]
    places = {tuple(trace.moving(frame)[0][0].round(3)) for frame in trace.frames}
    assert len(places) > 1  # he walked
    axes = new_figure(3, 3).add_subplot()
    draw_mover_trails(axes, trace, len(trace.steps))
    rings, _ = axes.collections
    assert 1 < len(rings.get_paths()) <= trace.end.time / TRAIL_S + 1


def test_a_still_picture_of_a_moment_comes_from_the_same_run(sweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["figure.moment=4s", "figure.subgoals=faded", "formats=[png]", "hydra.run.dir=out"]
    assert main(["figure", "trajectories", f"run={sweep}", *words]) == 0
    sky = np.array([0x56, 0xB4, 0xE9])
    with Image.open("out/trajectories.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    assert (np.abs(pixels - sky).sum(axis=2) < 150).mean() > 0.02  # beams


def test_more_panels_than_can_be_seen_are_refused(sweep, tmp_path, says):
    jobs = read_runs([sweep])
    with says.raises(InputError):
        Video(load_settings("figure/video")).draw(jobs * 4, [0], tmp_path / "v", [])


def test_a_world_that_was_not_driven_is_named(sweep, tmp_path, says):
    with says.raises(InputError, match="world.*7"):
        Video(load_settings("figure/video")).draw(read_runs([sweep]), [7], tmp_path / "v", [])


def test_mp4_is_smaller_than_gif(sweep, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    sizes = {}
    for kind in ("gif", "mp4"):
        config = load_settings(
            "figure/video", format=kind, speed=4.0, width=301, fps=4
        )  # odd: the encoder needs even sides
        (path,) = Video(config).draw(read_runs([sweep]), [0], tmp_path / "v", [])
        sizes[kind] = path.stat().st_size
        assert path.name == f"v.{kind}"
    assert (tmp_path / "v.mp4").read_bytes()[4:8] == b"ftyp"
    assert 0 < sizes["mp4"] < sizes["gif"]


def test_without_ffmpeg_an_error_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert main(["figure", "video", "figure.format=mp4", *WORDS]) == 2
    error = capsys.readouterr().err
    assert "pip install 'imageio-ffmpeg" in error
    assert "figure.format=gif" in error


def test_an_encoder_that_fails_is_one_line(tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(animation, "find_ffmpeg", lambda: str(program))
    pictures = [np.zeros((40, 40, 3), dtype=np.uint8)] * 200
    with pytest.raises(InputError, match=r"failed \(Unknown encoder libx264\)"):
        animation.write_film(pictures, Path(tmp_path / "a.mp4"), 10.0, pictures[:1])


def test_a_film_that_is_broken_off_leaves_the_one_before(tmp_path):
    picture = np.zeros((40, 40, 3), dtype=np.uint8)
    animation.write_film([picture] * 2, tmp_path / "a.gif", 10.0, [picture])
    before = (tmp_path / "a.gif").read_bytes()

    def broken_off():
        yield from [picture] * 3
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animation.write_film(broken_off(), tmp_path / "a.gif", 10.0, [picture])
    assert (tmp_path / "a.gif").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


@pytest.mark.parametrize(
    ("key", "value"), [("format", "avi"), ("speed", 0), ("fps", 0), ("fps", 1000), ("width", 10), ("sped", 2)]
)
def test_a_setting_that_makes_no_sense_is_named(key, value):
    node = {**shipped().values("figure/video"), key: value}
    with pytest.raises(InputError, match=f"figure.{key}"):
        build(node, "figure")
