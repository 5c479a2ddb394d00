"""Whole episodes as they were when somebody last looked; `tests/golden/refresh.py` renews them."""

import json

import pytest

from lme.guides.lme.criteria import SURMOUNT
from tests.golden import refresh

PATHS = sorted(refresh.FOLDER.glob("*.json"))


def golden(path):
    return json.loads(path.read_text("utf-8"))


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_a_golden_episode_repeats_itself(path):
    record = golden(path)
    assert not refresh.differences(record["result"], refresh.play(record["config"])), (
        "python -m tests.golden.refresh, if the new result is right"
    )


def test_golden_episodes_end_in_every_way():
    assert len(PATHS) >= 5
    results = [golden(path)["result"] for path in PATHS]
    assert {result["outcome"] for result in results} == {"success", "collision", "timeout"}
    assert any(result["switches"] > 3 for result in results)
    assert any(result["no_free_candidate"] > 0 for result in results)
    assert all(golden(path)["why"] for path in PATHS)
    guides = [guide for path in PATHS if (guide := golden(path)["config"]["guide"])]
    assert {guide["surmount"] for guide in guides} == {*SURMOUNT}


@pytest.mark.parametrize(
    "change", [{"steps": 7}, {"outcome": "lost"}, {"path_length_m": 1e-5}, {"trajectory": []}]
)
def test_a_changed_result_is_shown(change):
    result = golden(PATHS[0])["result"]
    key = next(iter(change))
    changed = {key: result[key] + change[key]} if key == "path_length_m" else change
    (line,) = refresh.differences(result, {**result, **changed})
    assert line.startswith(f"{key}: ")


def test_nothing_is_refreshed_without_a_reason(tmp_path, monkeypatch, capsys):
    record = golden(PATHS[0])
    old = {**record, "result": {**record["result"], "steps": 0}}
    path = tmp_path / "some.json"
    path.write_text(json.dumps(old), "utf-8")
    monkeypatch.setattr(refresh, "FOLDER", tmp_path)
    monkeypatch.setattr("builtins.input", lambda _: "  ")
    refresh.main()
    assert golden(path) == old
    assert "steps: 0 on record" in capsys.readouterr().out
    monkeypatch.setattr("builtins.input", lambda _: "the clock was wrong")
    refresh.main()
    assert golden(path)["why"] == [*record["why"], "the clock was wrong"]
    assert golden(path)["result"] == record["result"]
