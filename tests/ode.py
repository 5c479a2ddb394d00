"""Wheels against Open Dynamics Engine, Gazebo's: random commands for a Jackal, and what it made of them."""

import csv
import math
from itertools import groupby

import numpy as np

from tests import tolerances
from tests.places import ROOT

# Made by benchmarks/ode_jackal.cpp from the commands in it.
TABLE = ROOT / "tests" / "lme" / "geometry" / "ode_jackal.csv"


def check_random_commands(drive, axes):
    """Hold a model of the wheels against the engine.

    drive: returns rows x, y, yaw, vx (ahead), vy (left), ω of the base, one after each of the commands (N, 2).
    """
    errors, ends = [], []
    with TABLE.open(encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if row[0] == axes]
    for _, run in groupby(rows, key=lambda row: row[1]):
        table = np.array([row[2:] for row in run], dtype=float)
        driven = drive(table[:, :2], axes)
        errors.append(driven[:, 3:] - table[:, 5:])
        ends.append(math.dist(driven[9, :2], table[9, 2:4]))
    ahead, left, turning = np.sqrt(np.mean(np.vstack(errors) ** 2, axis=0))
    assert ahead < tolerances.ODE_SPEED
    assert left < tolerances.ODE_SPEED
    assert turning < tolerances.ODE_TURN_RATE
    assert np.sqrt(np.mean(np.square(ends))) < tolerances.ODE_POSITION
