"""The file itself: small, whole, and the same for the same episode."""

import base64
import copy
import dataclasses
import gzip
import html
import json

import numpy as np
import pytest

from lme.errors import InputError
from lme.guides.lme.criteria import SURMOUNT
from runners.reports.explainer import write
from runners.reports.explainer.encode import encode
from runners.reports.explainer.packer import Packer
from runners.reports.explainer.write import page, write_page
from runners.workers.trace import rerun
from tests.runners.reports.explainer.conftest import traced

MOST_BYTES = 5_000_000
OWN = "tests.runners.reports.explainer.test_write.a_left"


def a_left(candidates, view):
    """A custom criterion: how far to the left."""
    return candidates[:, 1]


def unpacked(text):
    raw = gzip.decompress(base64.b64decode(text))
    length = int.from_bytes(raw[:4], "little")
    return json.loads(raw[4 : 4 + length]), raw[4 + length :]


def array(text, name):
    """An array as `assets/data.js` reads it."""
    head, planes = unpacked(text)
    kind, at, count, differences = head["arrays"][name]
    size = np.dtype(f"<{kind}").itemsize
    part = np.frombuffer(planes, np.uint8, count * size, at).reshape(size, count).T
    numbers = np.ascontiguousarray(part).view(f"<{kind}").ravel()
    return np.cumsum(numbers, dtype=np.int64) if differences else numbers


def test_numbers_come_through_to_the_last_bit():
    rng = np.random.default_rng(0)
    values = np.concatenate(
        [rng.normal(size=50) * 10.0 ** rng.integers(-300, 300, 50), [np.inf, -0.0, np.nan]]
    )
    made = Packer()
    made.add_doubles("values", values)
    assert array(made.text({}), "values").tobytes() == values.tobytes()


@pytest.mark.parametrize("differences", [False, True])
@pytest.mark.parametrize("limit", [100, 30_000, 2_000_000])
def test_whole_numbers_come_through_whatever_their_size(differences, limit):
    values = np.random.default_rng(1).integers(-limit, limit, 200)
    made = Packer()
    made.add_integers("values", values, differences)
    np.testing.assert_array_equal(array(made.text({}), "values"), values)


def test_an_episode_of_300_steps_and_300_candidates_stays_small(tmp_path):
    long = traced(207, "sim=fast", "map.worlds=[207]", "map.time_limit=35")
    assert len(long.steps) >= 300
    assert min(len(step.explanation.scores) for step in long.steps) >= 300
    write_page(long, tmp_path / "long.html")
    assert (tmp_path / "long.html").stat().st_size < MOST_BYTES


def test_the_same_episode_gives_the_same_file(trace):
    sentences = write.sentences(trace)
    assert page(trace, sentences) == page(trace, sentences)


def test_everything_is_in_the_file_and_nothing_is_left_to_fill_in(page_file):
    text = page_file.read_text("utf-8")
    assert "{{" not in text.partition("<style>")[0]
    assert "connect-src" not in text  # default-src 'none' stands for it
    assert "default-src 'none'" in text
    assert "Copyright (c) 2022 Leon Sorokin" in text  # uPlot's licence goes where uPlot goes
    assert 'src="' not in text
    assert text.count("<script") == 2


def test_names_are_text_and_nothing_else(trace):
    name = '{{DATA}}</title><script>alert("1")</script>'
    text = page(trace._replace(task=dataclasses.replace(trace.task, map_name=name)), [])
    said = html.escape(f"{name} 1, run 0")
    assert f"<title>{said}</title>" in text
    assert f'<h1 id="title">{said}</h1>' in text  # without a script as well
    assert text.count("<script") == 2


def test_a_page_that_cannot_be_written_is_named(tmp_path, says):
    with says.raises(InputError):  # not the draft's name
        write.write_html(tmp_path / "new" / "page.html", "whole")


def test_the_episode_lasts_as_its_record_says(trace):
    late = trace._replace(episode=dataclasses.replace(trace.episode, time=3.25))
    assert unpacked(encode(late, [], "LME"))[0]["time"] == 3.25
    assert unpacked(encode(late, [], "LME"))[0]["system"] == "LME"


def test_the_account_is_that_of_the_record_with_what_older_records_lack(trace):
    collided = trace._replace(
        episode=dataclasses.replace(trace.episode, outcome="collision", contact_part="left")
    )
    assert "an obstacle with its left" in write.account(collided)
    older = write.account(collided, {"contact_part": "", "robot_on_person_collision": 1.0})
    assert "a person with its left" in older


def test_every_script_is_part_of_a_page():
    scripts = {path.name for path in write.ASSETS.glob("*.js")}
    assert scripts == {*write.SCRIPTS, "leaderboard.js", "training.js"}  # those of other pages


@pytest.mark.parametrize("surmount", SURMOUNT)
def test_the_surmount_feature_means_what_its_reading_says(trace, surmount):
    config = copy.deepcopy(trace.config)
    config.map["time_limit"] = 1.0
    config.guide["surmount"] = surmount
    short = rerun(config, 1, 0)
    head, _ = unpacked(encode(short, write.sentences(short)))
    assert head["about"]["a_mount"] == SURMOUNT[surmount].__doc__.splitlines()[0]


def test_a_criterion_of_ones_own_comes_with_the_others(trace):
    config = copy.deepcopy(trace.config)
    config.map["time_limit"] = 2.0
    config.guide["criteria"]["a_left"] = OWN
    config.guide["parameters"]["a_left"] = 3.0
    own = rerun(config, 1, 0)
    reasons = [step.explanation for step in own.steps]
    text = encode(own, write.sentences(own))
    head, _ = unpacked(text)
    assert head["names"][-1] == "a_left"
    assert head["about"]["a_left"] == "A criterion of your own."
    assert head["parameters"]["a_left"] == 3.0
    expected = np.concatenate([why.candidates[:, 1] for why in reasons])
    np.testing.assert_array_equal(array(text, "feature.a_left"), expected)


def test_bytes_are_the_same_at_any_time(monkeypatch):
    made = Packer()
    made.add_integers("values", [1, 2, 3])
    first = made.text({})
    monkeypatch.setattr("time.time", lambda: 2e9)
    assert made.text({}) == first
