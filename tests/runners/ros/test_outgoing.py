"""The markers of a decision, without ROS."""

import numpy as np
import pytest

from lme.types import Guidance
from runners.ros.outgoing import Shape, markers
from tests import builders


@pytest.fixture(scope="module")
def decided():
    """An observation with an obstacle ahead, and LME's decision on it."""
    robot = builders.stage()
    ranges = np.full(robot.lidar.num_beams, robot.lidar.range_max, np.float32)
    ranges[260:280] = 1.0
    seen = builders.observation(ranges=ranges, robot=robot)
    why = builders.explained(builders.escaper(robot=robot), seen)
    return seen, Guidance(why.decision.subgoal), why


def groups(found):
    return {one.group: one for one in found}


def test_every_part_of_a_decision_is_drawn_where_it_is(decided):
    seen, guidance, why = decided
    found = groups(markers(seen, guidance, why))
    np.testing.assert_array_equal(found["candidates"].points, why.candidates)
    np.testing.assert_array_equal(found["subgoal"].points, [guidance.subgoal])
    np.testing.assert_array_equal(found["target"].points, [seen.target])
    drawn = [one for one in markers(seen, guidance, why) if one.group == "A and B"]
    np.testing.assert_array_equal(
        [one.points[0] for one in drawn], [why.view.blockage.A, why.view.blockage.B]
    )
    assert [one.text for one in markers(seen, guidance, why) if one.shape is Shape.TEXT] == ["A", "B"]
    assert sum(len(one.points) for one in markers(seen, guidance, why) if one.group == "sectors") == len(
        why.view.points
    )


def test_the_best_candidate_is_yellow_and_the_worst_violet(decided):
    seen, guidance, why = decided
    colours = groups(markers(seen, guidance, why))["candidates"].colours
    best, worst = colours[np.argmax(why.scores)], colours[np.argmin(why.scores)]
    assert best[0] > best[2]  # red over blue
    assert worst[2] > worst[1]  # blue over green


def test_no_two_markers_of_a_group_have_the_same_number(decided):
    found = [(one.group, one.number) for one in markers(*decided)]
    assert len(found) == len(set(found))


def test_a_guide_that_cannot_explain_shows_its_path(decided):
    seen = decided[0]
    path = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]])
    found = groups(markers(seen, Guidance(path[1], path), None))
    assert set(found) == {"path", "target", "subgoal"}
    np.testing.assert_array_equal(found["path"].points, path)
