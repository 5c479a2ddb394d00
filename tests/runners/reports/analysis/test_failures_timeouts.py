"""The section on time-outs, and the measure that it counts."""

import numpy as np
import pandas as pd
import pytest

from lme.metrics import last_extent
from runners.reports.analysis.failures import timeouts_section


def records(*episodes):
    """Records of system, outcome, time and extent of the last minute."""
    frame = pd.DataFrame(episodes, columns=["system", "outcome", "time_s", "last_minute_m"])
    return frame.assign(world=range(len(frame)), run=0)


def test_time_outs_are_counted_by_what_the_robot_did_last():
    frame = records(
        ("LME", "timeout", 240.0, 0.1), ("LME", "timeout", 240.0, 0.6), ("LME", "timeout", 240.0, 2.9),
        ("LME", "timeout", 240.0, 3.0), ("LME", "collision", 80.0, 0.0), ("LME+", "success", 80.0, 9.0),
        ("LME+", "timeout", 240.0, 30.0),
    )  # fmt: skip
    lines = timeouts_section(frame).splitlines()
    assert lines[3] == "| System | Time-outs | stands | to and fro | on its way |"
    assert lines[5:7] == ["| LME | 4 | 1 | 2 | 1 |", "| LME+ | 1 | 0 | 0 | 1 |"]


@pytest.mark.parametrize(
    "frame",
    [
        records(("LME", "success", 240.0, 0.1)),
        records(("LME", "timeout", 40.0, 0.1)),  # no minute has passed
        records(("LME", "timeout", 240.0, 0.1)).drop(columns="last_minute_m"),  # recorded before
        records(("LME", "timeout", 240.0, np.nan)),
    ],
)
def test_there_is_no_section_without_long_time_outs(frame):
    assert timeouts_section(frame) == ""


def test_the_extent_is_the_diagonal_of_the_last_minute():
    time = np.array([0.0, 39.9, 40.0, 70.0, 100.0])
    places = np.array([[50.0, 0.0], [9.0, 9.0], [0.0, 4.0], [3.0, 0.0], [1.0, 1.0]])
    assert last_extent(time, places) == 5.0
    assert last_extent(time, places, seconds=1.0) == 0.0
    assert last_extent([], np.empty((0, 2))) == 0.0
