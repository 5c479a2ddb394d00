"""The sentence about an episode, and the order of how badly episodes end."""

import math

import numpy as np
import pytest

from lme.simulation.simulator import FALL
from runners.reports.analysis.what_happened import what_happened

DT = 0.1
STILL = (0.0, 0.0)


def drive(*parts, subgoal=(9.0, 0.0), clearance=1.0):
    """Control steps of parts (seconds, v [m/s], omega [rad/s]) from the origin, and an end.

    subgoal: (x, y) [m], or a function of the time.
    """
    rows, time, x, y, yaw = [], 0.0, 0.0, 0.0, 0.0
    for seconds, v, omega in [*parts, (DT, *parts[-1][1:])]:
        for _ in range(round(seconds / DT)):
            place = subgoal(time) if callable(subgoal) else subgoal
            rows.append((time, x, y, yaw, v, omega, *place, 0.0, clearance))
            yaw += omega * DT
            x, y, time = x + v * DT * math.cos(yaw), y + v * DT * math.sin(yaw), time + DT
    return np.array(rows)


def told(outcome, trajectory, **record):
    row = {"outcome": outcome, "final_distance_m": 4.0, "path_length_m": 12.0, "shortest_path_length_m": 10.0}
    return what_happened({**row, **record}, trajectory)


def to_and_fro(*, back=-0.5):
    return drive(*[(4.0, 0.5, 0.0), (4.0, back, 0.0)] * 8)


@pytest.mark.parametrize(
    ("trajectory", "record"),
    [
        (drive((60.0, *STILL)), {}),
        (drive((60.0, *STILL), subgoal=(0.1, 0.0)), {}),
        (drive((60.0, *STILL), clearance=0.06), {}),
        (drive((60.0, *STILL)), {"no_free_candidate": 480, "steps": 600}),
        (drive((20.0, 0.5, 0.0), (40.0, 0.0, 0.5)), {}),
        (drive(*[(0.4, 0.3, 0.0), (0.4, -0.3, 0.0)] * 40), {}),
        (to_and_fro(), {}),
        (drive((60.0, 0.5, 0.5)), {}),
        (drive((60.0, 0.2, 0.0)), {}),
        (drive((8.0, *STILL)), {}),
        (np.empty((0, 10)), {}),
    ],
    ids=[
        "stood",
        "at_subgoal",
        "tight",
        "blocked",
        "turned",
        "twitched",
        "paced",
        "circled",
        "under_way",
        "short",
        "no_steps",
    ],
)
def test_a_time_out_says_how_the_time_was_lost(trajectory, record, says):
    says(told("timeout", trajectory, **record).sentence)


def test_a_subgoal_that_jumps_is_the_cause(says):
    """It jumps from one side to the other every two seconds while the robot turns little."""
    sides = [(2.0 * math.cos(angle), 2.0 * math.sin(angle)) for angle in np.radians([110.0, -100.0])]
    halves = [(2.0, 0.0, 0.2), (2.0, 0.0, -0.2)] * 15
    says(told("timeout", drive(*halves, subgoal=lambda time: sides[int(time / 2.0) % 2])).sentence)
    few = drive(*halves, subgoal=lambda time: sides[int(time / 25.0) % 2])
    assert "jumped" not in told("timeout", few).sentence


@pytest.mark.parametrize(
    ("trajectory", "record"),
    [
        (drive((5.0, 0.8, 0.0)), {"contact_part": "front left"}),
        (drive((5.0, 0.8, 0.0), (0.3, 0.5, 0.0)), {"contact_part": "front"}),
        (drive((5.0, 0.8, 0.0)), {"contact_part": "trunk"}),
        (drive((5.0, 0.8, 0.0)), {"contact_part": "foot"}),
        (drive((5.0, -0.3, 0.0)), {"contact_part": "rear"}),
        (drive((5.0, 0.0, 0.7)), {"contact_part": "rear right"}),
        (drive((5.0, 0.8, 0.0)), {"robot_on_person_collision": 1.0, "contact_part": "front"}),
        (drive((5.0, *STILL)), {"person_on_robot_collision": 1.0, "contact_part": "left"}),
        (drive((5.0, 0.3, 0.0)), {"person_on_robot_collision": 1.0, "contact_part": "rear"}),
        (drive((5.0, *STILL)), {}),
        (drive((30.0, *STILL), (2.0, 0.8, 0.0)), {}),
        (np.empty((0, 10)), {"contact_part": "front"}),
    ],
    ids=[
        "drove",
        "braked",
        "trunk",
        "foot",
        "backed",
        "turned",
        "person",
        "stood",
        "rear_ended",
        "still",
        "stood_before",
        "no_steps",
    ],
)
def test_a_collision_says_what_touched_and_how_fast(trajectory, record, says):
    says(told("collision", trajectory, **record).sentence)


def test_falls_and_other_ends(says):
    says(told("collision", drive((5.0, 0.4, 0.0)), contact_part=FALL).sentence)
    says(told("success", drive((15.0, *STILL), (9.0, 1.0, 0.0))).sentence)
    says(told("success", drive((9.0, 1.0, 0.0)), shortest_path_length_m=math.nan).sentence)
    says(told("success", drive((9.0, 1.0, 0.0)), path_length_m=9.4).sentence)  # stops within the tolerance
    says(told("cancelled", drive((9.0, 1.0, 0.0))).sentence)


def test_the_worst_comes_first():
    fast, slow, standing = (drive((5.0, v, 0.0)) for v in (0.8, 0.2, 0.0))
    worst_first = [
        told("collision", fast),
        told("collision", slow),
        told("collision", standing, person_on_robot_collision=1.0),
        told("collision", fast, contact_part=FALL),
        told("timeout", fast, final_distance_m=9.0),
        told("timeout", fast, final_distance_m=2.0),
        told("success", fast),
    ]
    ranks = [account.rank for account in worst_first]
    assert ranks == sorted(ranks)
    assert len(set(ranks)) == len(ranks)


def test_records_of_older_runs_have_an_account():
    """They lack the columns that came later, and their steps may have been deleted."""
    assert what_happened({"outcome": "timeout"}, np.empty((0, 10))).rank[0] == 2
    assert (
        "None"
        not in what_happened({"outcome": "collision", "contact_part": None}, drive((1.0, 0.5, 0.0))).sentence
    )
