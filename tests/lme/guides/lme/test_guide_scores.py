"""What the escaper scores, and what does not change when a scene is mirrored, turned or shuffled."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.guides.lme import criteria
from lme.guides.lme.criteria import View
from lme.guides.lme.guide import PAPER_CRITERIA, Lme
from lme.guides.lme.score import Parameters, score
from lme.guides.lme.surmount import RULES, find_blockage
from lme.robots import Lidar
from lme.types import Pose, Twist
from tests import oracles
from tests.builders import (
    PUBLISHED,
    assert_same,
    escape,
    escaper,
    explained,
    inject,
    observation,
    only,
    stage,
)
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
NAMES = tuple(PAPER_CRITERIA)


@pytest.mark.parametrize(("seed", "surmount"), enumerate(criteria.SURMOUNT))
def test_features_and_scores_are_those_of_the_paper(seed, surmount):
    made = escaper(seed=seed, surmount=surmount)
    blocked_some = False
    for view in escape(seed):
        seen = explained(made, view)
        pool = seen.candidates if seen.old is None else np.vstack([seen.candidates, seen.old])
        rows, scores = seen.features, seen.scores
        if seen.old is not None:
            rows = np.hstack([rows, seen.old_features[:, None]])
            scores = np.append(scores, seen.old_score)
        expected = by_definition(pool, seen.view, view.target)
        blocked_some |= not expected["c_o"].all() and not expected["c_t"].all() and expected["a_mount"].any()
        assert seen.names == tuple(expected)
        assert rows == pytest.approx(np.array(list(expected.values())), abs=KERNEL)
        total = sum(PUBLISHED[name] * values for name, values in expected.items())
        assert scores == pytest.approx(total, abs=1e3 * KERNEL)
        assert seen.new == int(np.argmax(seen.scores))
        assert not seen.decision.blocked  # some candidates are, but not all
    assert blocked_some


def by_definition(pool, view, target):
    """Eqs. 2–6 and Algorithm 2 without any cleverness."""
    free = lambda apex, points: 1.0 - oracles.fan_blocked(apex, pool, points, 0.2)  # noqa: E731
    mount = np.zeros(len(pool))
    if view.blockage is not None:
        counts = oracles.fan_blocked(target, pool, view.blockage.points, 0.2) | (view.surmount == "every")
        mount = -1.0 * counts * np.hypot(*(pool - view.blockage.B).T)
    return {
        "a_close": -np.hypot(*(pool - target).T),
        "a_dev": -np.abs(np.arctan2(pool[:, 1], pool[:, 0])),
        "c_o": free(np.zeros(2), view.points),
        "c_t": free(target, view.points),
        "a_mount": mount,
        "c_h": free(np.zeros(2), view.history),
    }


def test_weights_go_by_name_whatever_their_order():
    shuffled = dict(sorted(PUBLISHED.items(), reverse=True))
    parameters = Parameters.from_mapping(shuffled, NAMES)
    assert parameters.weights.tolist() == [1.51, 1.56, 999.8, 205.84, 88.7, 134.9]
    assert (parameters.d1, parameters.d2) == (0.51, 200.0)


@pytest.mark.parametrize(
    ("name", "value"), zip(NAMES, [math.inf, -1.0, -1e-9, math.nan, -math.inf, -1.0], strict=True)
)
def test_a_weight_must_be_finite_and_not_negative(name, value, says):
    with says.raises(InputError, match=f"{name}.*{value:g}"):
        escaper({**PUBLISHED, name: value})


@pytest.mark.parametrize("name", ["d1", "d2"])
def test_a_threshold_may_be_infinite_but_not_negative(name, says):
    escaper({**PUBLISHED, name: math.inf})
    for value in (-0.1, math.nan, -math.inf):
        with says.raises(InputError, match=f"{name}.*{value:g}"):
            escaper({**PUBLISHED, name: value})


def test_parameters_must_be_all_there_and_no_more(says):
    with says.raises(InputError):
        escaper({**PUBLISHED, "a_clos": 1.0})
    with pytest.raises(InputError, match="parameter d2 is missing"):
        escaper({name: value for name, value in PUBLISHED.items() if name != "d2"})


def leftness(candidates, view):
    """A custom criterion."""
    return candidates[:, 1]


def test_a_criterion_of_ones_own_counts(says):
    config = load_settings(
        "guide/lme", parameters=only(leftness=1.0), criteria={"leftness": f"{__name__}.leftness"}
    )
    guide = Lme(config, stage())
    seen = explained(guide.escaper, observation(target=(8.0, 0.0)))
    assert seen.names == (*NAMES, "leftness")
    assert seen.new == int(np.argmax(seen.candidates[:, 1]))
    with says.raises(InputError, match=r"x.*'lme\.nowhere\.x'"):
        Lme(
            load_settings("guide/lme", parameters={**PUBLISHED, "x": 1.0}, criteria={"x": "lme.nowhere.x"}),
            stage(),
        )


def overwriting(candidates, view):
    """A custom criterion that writes to its arguments."""
    value = candidates[:, 1].copy()
    candidates -= view.target
    view.points[:] = 0.0
    return value


def test_a_criterion_may_write_to_its_arguments():
    decisions = []
    for name in ("leftness", "overwriting"):
        config = load_settings(
            "guide/lme", parameters={**PUBLISHED, "own": 1.0}, criteria={"own": f"{__name__}.{name}"}
        )
        seen = explained(Lme(config, stage()).escaper, observation(target=(8.0, 0.0)))
        decisions.append((seen.candidates, seen.features, seen.new))
    for one, other in zip(*decisions, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_criterion_that_takes_other_arguments_is_named(says):
    name = f"{__name__}.scores_of_one"
    with says.raises(InputError):
        Lme(load_settings("guide/lme", parameters={**PUBLISHED, "x": 1.0}, criteria={"x": name}), stage())


def scores_of_one(candidates): ...


# --- symmetries ------------------------------------------------------------------------------------------


FLIP = np.array([1.0, -1.0])


def random_view(rng, robot):
    """Some walls and gaps, none so near that opposite beams could be one obstacle."""
    lengths = rng.integers(1, 40, robot.lidar.num_beams)
    ranges = np.repeat(rng.uniform(0.5, 6, len(lengths)), lengths)[: robot.lidar.num_beams]
    ranges = (ranges + rng.uniform(0, 0.2, len(ranges))).astype(np.float32)
    ranges[rng.random(len(ranges)) < 0.2] = robot.lidar.range_max
    ranges[0] = robot.lidar.range_max  # straight behind on a full circle: ±π are the same there
    twist = Twist(rng.uniform(0, 0.5), rng.uniform(-1, 1))
    return observation(rng.uniform(-6, 6, 2), ranges, twist, robot)


def mirror(view, full_circle):
    flipped = view.scan.ranges[::-1]
    scan = view.scan._replace(ranges=np.roll(flipped, 1) if full_circle else flipped.copy())
    return view._replace(scan=scan, target=view.target * FLIP, twist=Twist(view.twist.v, -view.twist.omega))


def mounted(fov, y, yaw):
    lidar = Lidar(num_beams=180, fov=fov, range_min=0.02, range_max=8.0, x=0.05, y=y, yaw=yaw)
    return stage(lidar=lidar)


@given(SEEDS, st.booleans(), st.sampled_from(RULES), st.sampled_from([*criteria.SURMOUNT]))
def test_a_mirrored_scene_is_answered_by_the_mirrored_subgoal(seed, full_circle, rule, surmount):
    rng = np.random.default_rng(seed)
    fov = 2 * math.pi if full_circle else 1.5 * math.pi
    y, yaw = rng.uniform(-0.1, 0.1), rng.uniform(-0.5, 0.5)
    one, two = mounted(fov, y, yaw), mounted(fov, -y, -yaw)
    left, right = (escaper(robot=each, blocking=rule, surmount=surmount) for each in (one, two))
    for _ in range(4):
        view, draw = random_view(rng, one), rng.uniform(-4, 4, (60, 2))
        with pytest.MonkeyPatch.context() as patch:
            inject(patch, draw)
            seen = explained(left, view)
            inject(patch, draw * FLIP)
            mirrored = mirror(view, full_circle)
            seen_mirrored = explained(right, mirrored)
        assert seen_mirrored.candidates == pytest.approx(seen.candidates * FLIP, abs=KERNEL)
        assert seen_mirrored.features == pytest.approx(seen.features, abs=KERNEL)
        assert seen_mirrored.scores == pytest.approx(seen.scores, abs=1e3 * KERNEL)
        assert seen_mirrored.new == seen.new
        decision, decision_mirrored = seen.decision, seen_mirrored.decision
        assert decision_mirrored.choice is decision.choice
        assert decision_mirrored.blocked == decision.blocked
        assert decision_mirrored.subgoal == pytest.approx(decision.subgoal * FLIP, abs=KERNEL)


def turned(points, angle):
    return to_world(np.asarray(points, dtype=float), Pose(0.0, 0.0, angle))


@given(SEEDS, st.floats(-math.pi, math.pi), st.sampled_from(RULES), st.sampled_from([*criteria.SURMOUNT]))
def test_a_turned_scene_has_the_same_features_but_for_a_dev(seed, angle, rule, surmount):
    rng = np.random.default_rng(seed)
    made = escaper()
    seen = explained(made, random_view(rng, stage()))
    points, target, history = seen.view.points, seen.view.target, rng.uniform(-1, 1, (8, 2))
    pool = rng.uniform(-5, 5, (100, 2))
    spun = turned(points, angle)
    spun = spun[np.argsort(np.arctan2(spun[:, 1], spun[:, 0]), kind="stable")]
    views = [
        View(p, t, 0.2, h, find_blockage(p, t, 0.2, True, rule), surmount)
        for p, t, h in ((points, target, history), (spun, turned(target, angle), turned(history, angle)))
    ]
    for name in ("a_close", "c_o", "c_t", "a_mount", "c_h"):
        before = PAPER_CRITERIA[name](pool, views[0])
        after = PAPER_CRITERIA[name](turned(pool, angle), views[1])
        assert after == pytest.approx(before, abs=KERNEL), name


@given(SEEDS)
def test_the_order_of_the_candidates_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    robot = stage()
    one, two = escaper(), escaper()
    for _ in range(3):
        view, draw = random_view(rng, robot), rng.uniform(-4, 4, (60, 2))
        order = rng.permutation(60)
        with pytest.MonkeyPatch.context() as patch:
            inject(patch, draw)
            seen = explained(one, view)
            inject(patch, draw[order])
            shuffled = explained(two, view)
        assert shuffled.scores[:60] == pytest.approx(seen.scores[:60][order], abs=1e3 * KERNEL)
        np.testing.assert_array_equal(shuffled.features[:, :60], seen.features[:, :60][:, order])
        assert_same(shuffled.decision, seen.decision)


@given(row=arrays(np.float64, 6, elements=st.floats(-1e3, 1e3)), count=st.integers(1, 320))
def test_equal_candidates_score_the_same_wherever_they_stand(row, count):
    weights = np.array([1.51, 1.56, 999.8, 205.84, 88.7, 134.9])
    scores = score(np.repeat(row[:, None], count, axis=1), weights)
    assert (scores == scores[0]).all()
