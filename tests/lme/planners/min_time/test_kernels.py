"""When a robot on an arc meets a mover."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.planners.min_time.kernels import FORESEEN, Estimate, Safety, best_twist
from tests import oracles
from tests.tolerances import KERNEL

MEETING, STRIKING, STEP = 10.0, 5.0, 0.1  # as in lme/planners/min_time/kernels.py
JACKAL, DISC = (0.21, 0.155, 0.0), (0.0, 0.0, 0.2)
ESTIMATE = Estimate(v_max=2.0, turn=0.5, period=0.1, horizon=0.5, slow=0.05)
SAFETY = Safety(margin=0.05, margin_time=0.1, brake=3.0, max_lateral_accel=100.0)
ALPHA = 8.0  # [rad/s²]
NOTHING, NOBODY = np.empty((0, 2)), np.empty((0, 5))


def best(v, omega, movers, box=JACKAL, subgoal=(3.0, 0.5)):
    v, omega, subgoal = (np.array(each, dtype=float) for each in (v, omega, subgoal))
    rest = (*ESTIMATE,), (*SAFETY,), np.array(movers, dtype=float).reshape(-1, 5)
    return best_twist(v, omega, ALPHA, subgoal, NOTHING, box, *rest)


def more(twist, movers, box=JACKAL):
    """By how much longer a command takes among movers [s]."""
    v, omega = twist
    return best([v], [omega], movers, box)[2] - best([v], [omega], NOBODY, box)[2]


def met(twist, movers, box=JACKAL):
    """The time until the robot meets somebody [s], from what the command counts more, if it could stand by then."""
    return FORESEEN * (1.0 - more(twist, movers, box) / MEETING)


@settings(max_examples=200)
@given(st.integers(0, 10**6), st.integers(1, 3), st.sampled_from([JACKAL, DISC]), st.booleans())
def test_meetings_agree_with_their_slow_twin(seed, count, box, straight):
    rng = np.random.default_rng(seed)
    twist = rng.uniform(0.0, 2.0), 0.0 if straight else rng.uniform(-3.0, 3.0)
    movers = np.column_stack((rng.uniform(-3.0, 3.0, (count, 2)), rng.uniform(-1.5, 1.5, (count, 2))))
    movers = np.column_stack((movers, rng.uniform(0.1, 0.5, count)))
    reach = math.hypot(*box[:2]) + box[2] + SAFETY.margin
    delay, brake = ESTIMATE.period + SAFETY.lag, SAFETY.brake
    rest = delay + twist[0] / brake
    meeting = oracles.meeting(twist, movers, reach, STEP, max(FORESEEN, rest))
    struck = oracles.meeting(twist, movers, reach, STEP, rest, delay, brake)
    left = max(twist[0] - brake * max(struck - delay, 0.0), 0.0) if meeting < math.inf else 0.0
    slow = MEETING * (1.0 - min(meeting, FORESEEN) / FORESEEN) + STRIKING * left
    assert more(twist, movers, box) == pytest.approx(slow, abs=KERNEL)


def test_a_meeting_is_the_last_step_before_it():
    reach = math.hypot(*JACKAL[:2]) + SAFETY.margin + 0.3
    ahead = [reach + 1.0 - 1e-6, 0.0, -0.5, 0.0, 0.3]  # 1 m to go at 0.5 + 1.5 m/s
    assert met((1.5, 0.0), ahead) == pytest.approx(0.4)
    assert met((1.5, 0.0), [*ahead[:2], 1.5, 0.0, 0.3]) == FORESEEN  # walks on ahead
    assert met((0.0, 0.0), [reach - 0.1, 0.0, 0.1, 0.0, 0.3]) == FORESEEN  # near, and leaves
    assert met((0.0, 0.0), [reach - 0.1, 0.0, -0.1, 0.0, 0.3]) == pytest.approx(0.0)  # near, and comes


def test_a_turn_is_braked_in_time():
    """At 2 rad/s and 1 rad/s² a robot turns on by 2 rad. To face a subgoal 1 rad away it brakes, 3 rad away not yet."""
    rates = np.array([1.9, 2.0, 2.1])
    for bearing, chosen in ((1.0, 1.9), (3.0, 2.1)):
        subgoal = 3.0 * np.array([math.cos(bearing), math.sin(bearing)])
        found = best_twist(
            np.zeros(1), rates, 1.0, subgoal, NOTHING, JACKAL, (*ESTIMATE,), (*SAFETY,), NOBODY
        )
        assert found[1] == chosen


@given(st.integers(0, 10**6), st.sampled_from([JACKAL, DISC]), st.integers(0, 2))
def test_the_best_of_all_pairs_is_the_best_of_each_alone(seed, box, people):
    rng = np.random.default_rng(seed)
    v, omega = np.sort(rng.uniform(0.0, 2.0, 4)), rng.uniform(-2.0, 2.0, 5)
    subgoal, points = rng.uniform(-3.0, 3.0, 2), rng.uniform(-2.0, 2.0, (rng.integers(0, 40), 2))
    movers = np.column_stack((rng.uniform(-3.0, 3.0, (people, 4)), np.full(people, 0.3)))
    given_ = ALPHA, subgoal, points, box, (*ESTIMATE,), (*SAFETY,), movers
    alone = [best_twist(np.array([a]), np.array([b]), *given_) for a in v for b in omega]
    best = min(alone, key=lambda found: found[2])  # the first of equal ones
    found = best_twist(v, omega, *given_)
    assert found[2] == best[2]
    assert found[:2] == best[:2] or best[2] == math.inf
