"""What is saved: a map that `lme eval map=file` drives alike, a record, a page, a film, a recording."""

import re
import shlex

import numpy as np
import pytest

from lme.errors import InputError
from runners.cli import main
from runners.play.drawing import item_of
from runners.play.opening import open_episode
from runners.play.saving import save
from tests.runners.play.conftest import drive, ways
from tests.runners.play.test_session import DISC, PERSON, WALL, edited

BOX = item_of("boxes", {"centre": [4.0, 2.5], "size": [0.8, 0.4], "yaw_deg": 30})
THIN = item_of("walls", {"points": [[3.0, 5.0], [4.0, 6.0], [5.0, 6.0]]})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def furnished(session):
    """With something of every kind, another start and another goal."""
    for name, item in (("d1", WALL), ("d2", DISC), ("d3", BOX), ("d4", THIN), ("d5", PERSON)):
        session.put(0, name, item)
    session.move_goal(0, (10.0, 6.25))
    session.move_start(0, session.script.at(0).start._replace(x=1.125, y=2.0, yaw=0.3))
    return session


def records(run_dir):
    from runners.records.records import read_episodes, read_trajectories

    return read_episodes([run_dir]), read_trajectories([run_dir])


def test_a_map_that_was_drawn_is_driven_alike_by_eval(session_of, folder):
    session = furnished(session_of("map.time_limit=40"))
    saved = save(session, "map", "drawn", folder, 0)
    assert str(saved.path) == "outputs/play/drawn.yaml"
    words = shlex.split(saved.command)
    assert words[:2] == ["lme", "eval"]
    system = ["system=lme_plus", "runs=1", "executor=serial", "tracking=none", "hydra.run.dir=run"]
    assert main.main([*words[1:], *system]) == 0
    _, driven = records(folder / "run")
    rows = np.array(ways(drive(session))[0])
    columns = ["time_s", "x_m", "y_m", "yaw_rad", "v_mps", "omega_radps", "clearance_m"]
    assert np.array_equal(driven[columns].to_numpy(), rows)


def test_a_record_of_a_drawn_world_is_a_run_like_any_other(session_of, folder):
    session = drive(furnished(session_of()))
    saved = save(session, "record", "mine", folder, 0)
    frame, driven = records(folder / saved.path)
    assert np.array_equal(driven[["x_m", "y_m"]].to_numpy(), np.array(ways(session)[0])[:, 1:3])
    assert (frame["system"][0], frame["map"][0], frame["steps"][0]) == ("LME+", "mine", session.last)
    assert np.isfinite(frame["shortest_path_length_m"][0])
    assert np.isfinite(frame["minimum_distance_to_people_m"][0])
    assert main.main(["explain", str(saved.path), "0/0", "--text"]) == 0
    again = open_episode(folder / saved.path, "0/0", None)
    assert ways(again) == ways(session)


@pytest.mark.parametrize("changes_the_world", [False, True])
def test_a_record_keeps_the_label_of_its_system(session_of, folder, changes_the_world):
    session = session_of("system=lme_plus", "system.label='My policy, 2'")
    session = edited(session) if changes_the_world else drive(session)
    saved = save(session, "record", "mine", folder, 0)
    assert records(folder / saved.path)[0]["system"].unique().tolist() == ["My policy, 2"]
    again = open_episode(folder / saved.path, "0/0", None)
    assert [lane.label for lane in again.lanes] == ["My policy, 2"]
    saved = save(drive(again), "record", "again", folder, 0)
    assert records(folder / saved.path)[0]["system"].unique().tolist() == ["My policy, 2"]


def test_a_record_of_a_world_that_changed_is_played_again_with_its_changes(session_of, folder, capsys, says):
    session = edited(session_of("sim.scan_noise=0.02"))
    saved = save(session, "record", "mine", folder, 0)
    again = open_episode(folder / saved.path, "0/0", 20)
    assert ways(again) == ways(session)
    assert main.main(["explain", str(saved.path), "0/0"]) == 2
    assert "lme play" in capsys.readouterr().err
    assert main.main(["table", str(saved.path)]) == 0
    (folder / saved.path / "trajectories.parquet").unlink()
    assert ways(open_episode(folder / saved.path, "0/0", 20)) == ways(session)
    assert main.main(["export", str(saved.path), "--steps"]) == 2
    says(capsys.readouterr().err)


def test_an_episode_of_a_map_set_keeps_its_world_in_its_record(session_of, folder):
    session = drive(session_of("map=barn", "map.worlds=[282]", "system=lme", run=1))
    saved = save(session, "record", "barn", folder, 0)
    frame, _ = records(folder / saved.path)
    assert (frame["world"][0], frame["run"][0], frame["map"][0]) == (282, 1, "barn")
    assert saved.command.endswith("282/1")


@pytest.mark.parametrize("changes", [edited, drive], ids=["changed", "untouched"])
def test_pages_films_and_recordings_are_whole(session_of, folder, changes):
    pytest.importorskip("rosbags")
    session = changes(session_of())
    page = folder / save(session, "page", "mine", folder, 0).path
    assert page.read_text().rstrip().endswith("</html>")
    film = folder / save(session, "gif", "mine", folder, 0).path
    assert film.read_bytes()[:6] == b"GIF89a"
    recording = folder / save(session, "mcap", "mine", folder, 0).path
    from runners.recordings.bags import Bag

    with Bag(recording) as bag:
        scans = sum(1 for _ in bag.messages(["/scan"]))
    assert scans == session.last


def test_a_drive_that_goes_on_can_be_a_page_but_not_a_record(session_of, folder):
    session = drive(session_of(), 20)
    with pytest.raises(InputError, match="has not ended"):
        save(session, "record", "mine", folder, 0)
    text = (folder / save(session, "page", "mine", folder, 0).path).read_text()
    assert re.search(r"<title>empty 0, run 0</title>", text)


def test_a_name_that_is_taken_gets_a_number_and_a_path_is_refused(session_of, folder):
    session = session_of()
    assert [str(save(session, "map", "a", folder, 0).path.name) for _ in range(3)] == [
        "a.yaml",
        "a-2.yaml",
        "a-3.yaml",
    ]
    for name in ("../a", "a/b", "", ".a", "a" * 61, "a.yaml"):
        with pytest.raises(InputError, match="must be letters"):
            save(session, "map", name, folder, 0)
