"""Logs of Gazebo and their comparison with our episodes, on logs made by hand."""

import math
from pathlib import Path

import pandas as pd
import pytest

from benchmarks.gazebo_logs import agreement, rates, read_log
from lme.errors import InputError
from tests.places import SHARED

LOGS = SHARED / "barn/dwa_out.txt", SHARED / "facts/gazebo_logs/bobae3_default.txt"
LOG = """0 1 0 0 20.0000 0.2500
0 0 1 0 7.5000 0.0000
6 0 0 1 100.0000 0.0000

12 1 0 0 30.5 0.2
"""
CSV = """block,world,success,collision,timeout,time_s,metric
0,16,1,0,0,10.697,0.5
0,148,0,0,1,100.037,0.0
1,16,0,1,0,3.2,0.0
"""


def written(tmp_path, text):
    path = tmp_path / "log.txt"
    path.write_text(text, encoding="utf-8")
    return path


def episodes(*rows):
    return pd.DataFrame(rows, columns=["world", "outcome", "time_s"])


def test_a_log_is_read(tmp_path):
    found = read_log(written(tmp_path, LOG))
    assert found.values.tolist() == [
        [0, "success", 20.0],
        [0, "collision", 7.5],
        [6, "timeout", 100.0],
        [12, "success", 30.5],
    ]


def test_a_csv_is_read_as_a_whole_or_by_block(tmp_path):
    path = written(tmp_path, CSV)
    assert len(read_log(path)) == 3
    assert read_log(path, "1").values.tolist() == [[16, "collision", 3.2]]


@pytest.mark.parametrize(
    ("text", "block"),
    [
        ("", None),
        (CSV, "7"),
        (LOG, "0"),
        ("0 1 0 0 fast 0.2\n", None),
        ("0 1 0\n", None),
        ("0 1 0 0 2 0.2\n6 1 1 0 2 0\n", None),
        ("6 0 0 0 2 0\n", None),
    ],
    ids=["empty", "block 7", "no blocks", "word", "short", "two outcomes", "no outcome"],
)
def test_a_bad_log_is_one_line(tmp_path, text, block, says):
    with says.raises(InputError):
        read_log(written(tmp_path, text), block)


def test_a_log_that_is_not_there_is_named(tmp_path, says):
    with says.raises(InputError):
        read_log(tmp_path / "none.txt")


def test_rates_and_the_time_of_success():
    found = rates(
        episodes((0, "success", 10.0), (0, "collision", 4.0), (1, "timeout", 100.0), (1, "success", 20.0))
    )
    assert (found.success, found.collision, found.timeout, found.time_s, found.episodes) == (
        0.5,
        0.25,
        0.25,
        15.0,
        4,
    )


def test_agreement_by_hand():
    ours = episodes((0, "success", 10.0), (1, "timeout", 100.0), (2, "success", 12.0), (3, "success", 1.0))
    theirs = episodes(
        (2, "success", 24.0),
        (2, "collision", 3.0),
        (0, "success", 20.0),
        (0, "success", 30.0),
        (1, "success", 50.0),
        (1, "timeout", 100.0),
        (9, "success", 1.0),
    )
    found = agreement(ours, theirs)
    assert (found.worlds, found.one.episodes, found.other.episodes) == (3, 3, 6)
    assert found.same_verdict == pytest.approx((1.0 + 0.5 + 0.5) / 3)
    assert found.correlation == pytest.approx(0.5)  # of (1, 0, 1) and (1, 0.5, 0.5)
    assert found.time_ratio == pytest.approx((10.0 / 25.0 + 12.0 / 24.0) / 2)
    assert found.time_correlation == pytest.approx(-1.0)  # of (10, 12) and (25, 24)


def test_agreement_with_itself_and_without_spread():
    ours = episodes((0, "success", 10.0), (1, "collision", 2.0))
    found = agreement(ours, ours)
    assert (found.correlation, found.same_verdict, found.time_ratio) == (pytest.approx(1.0), 1.0, 1.0)
    assert math.isnan(found.time_correlation)  # of one world
    alone = agreement(ours[:1], ours[:1])
    assert math.isnan(alone.correlation)
    assert math.isnan(agreement(ours[1:], ours[1:]).time_ratio)


def test_worlds_in_common_are_needed(says):
    with says.raises(InputError):
        agreement(episodes((0, "success", 1.0)), episodes((1, "success", 1.0)))


@pytest.mark.skipif(not all(map(Path.is_file, LOGS)), reason="needs the public logs in ../shared")
def test_the_two_public_logs_of_the_default_stack():
    found = agreement(*map(read_log, LOGS))
    assert (found.one.success, found.one.collision, found.one.timeout) == pytest.approx((0.85, 0.056, 0.094))
    assert (found.other.success, found.other.collision, found.other.timeout) == pytest.approx(
        (0.924, 0.016, 0.06)
    )
    assert found.correlation == pytest.approx(0.75, abs=0.005)


@pytest.mark.parametrize(
    ("name", "episodes"),
    [("bobae3_run1", 250), ("bobae3_run4", 250), ("drlvo", 500), ("lics", 500), ("mppi", 78)],
)
def test_the_other_public_logs_are_read(name, episodes):
    path = SHARED / f"facts/gazebo_logs/{name}.txt"
    if not path.is_file():
        pytest.skip(f"needs {path}")
    assert rates(read_log(path)).episodes == episodes


@pytest.mark.parametrize("block", ["0", "17", "20", "83", "96", "99"])
def test_a_block_of_the_lab_s_log_is_a_pass_over_its_hundred_worlds(block):
    path = SHARED / "facts/gazebo_eit.csv"
    if not path.is_file():
        pytest.skip(f"needs {path}")
    assert len(set(read_log(path, block)["world"])) == 100
