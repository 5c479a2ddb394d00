"""The scores of tracks, worked out by hand."""

import numpy as np
import pytest

from benchmarks.people.score import Score
from lme.perception.people.interface import Tracks


def tracks(*rows):
    """Tracks from (name, x, y, vx, vy)."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    some = np.zeros(len(table))
    return Tracks(table[:, 0].astype(int), table[:, 1:], some, some, np.zeros((len(table), 4, 4)))


def truth(*rows):
    """Names and places of people, from (name, x, y, vx, vy)."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return table[:, 0].astype(int), table[:, 1:]


def test_scores_of_two_scans():
    score = Score()
    score.begin()
    score.add(*truth((1, 0, 0, 1, 0), (2, 5, 0, 0, 0)), tracks((7, 0.1, 0, 1, 0.3), (8, 9, 9, 0, 0)))
    score.add(*truth((1, 0.1, 0, 1, 0)), tracks((9, 0.1, 0, 1, 0.1)))
    found = score.result()
    assert found["recall"] == pytest.approx(2 / 3)  # person 2 was missed
    assert found["precision"] == pytest.approx(2 / 3)  # track 8 is false
    assert found["switches"] == 1  # person 1 was track 7, then 9
    assert found["mota"] == pytest.approx(1 - (1 + 1 + 1) / 3)
    assert found["false"] == 0.5
    assert found["median"] == pytest.approx(0.2)
    assert found["rms"] == pytest.approx(np.sqrt((0.3**2 + 0.1**2) / 2))


def test_a_track_of_somebody_who_is_not_scored_is_neither_right_nor_false():
    score = Score()
    score.begin()
    score.add(*truth((1, 0, 0, 1, 0)), tracks((7, 0, 0, 1, 0), (8, 3, 0, 0, 0)), np.array([[3.2, 0.0]]))
    assert score.result()["precision"] == 1.0


def test_a_new_episode_numbers_anew():
    score = Score()
    for name in (7, 8):
        score.begin()
        score.add(*truth((1, 0, 0, 1, 0)), tracks((name, 0, 0, 1, 0)))
    assert score.result()["switches"] == 0
