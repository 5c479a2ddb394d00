"""LME+ as a guide: it picks the target in the open, leaves traps, mirrors, repeats itself, and tells why."""

import math

import numpy as np
import pytest

import lme.guides.lme_plus.guide
from lme.config.presets import load_settings
from lme.guides.lme.explanation import reason, reasons
from lme.guides.lme.maintenance import Choice
from lme.guides.lme_plus.criteria import CRITERIA
from lme.guides.lme_plus.guide import LmePlus
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.min_time.planner import MinTime
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Twist
from lme.worlds.world import World
from tests.builders import CLUTTER, assert_same, observation, room, shipped, stage, task, without_errors
from tests.tolerances import KERNEL, MIRROR_TIME, MIRROR_TURN

WEIGHTS = {"a_reach": 1.0, "a_dev": 0.3, "a_rest": 1.0, "c_o": 1000.0, "d1": 0.5, "d2": 0.3}
FLIP = np.array([1.0, -1.0])
JACKAL = without_errors(shipped("jackal"))
DEAD_END = World(  # 2 m wide and 2.5 m deep, open to the start
    segments=np.array([[0.5, 1.0, 3.0, 1.0], [3.0, 1.0, 3.0, -1.0], [3.0, -1.0, 0.5, -1.0]])
)
ZIGZAG = World(
    segments=np.array(
        [[2.0, -3.0, 2.0, 0.8], [3.5, -0.8, 3.5, 3.0], [1.0, 3.0, 6.0, 3.0], [1.0, -3.0, 6.0, -3.0]]
    )
)


def guide(robot=None, seed=0, parameters=WEIGHTS, **settings):
    made = LmePlus(load_settings("guide/lme_plus", parameters=parameters, **settings), robot or stage())
    made.reset(np.random.default_rng(seed))
    return made


def drive(world, robot=JACKAL, goal=(6.0, 0.0), seed=0, time_limit=40.0, **settings):
    """The episode, and the explanation of each decision."""
    made = guide(robot, **settings)
    navigator = Navigator(made, MinTime(load_settings("planner/min_time"), robot))
    steps, act = [], navigator.act

    def tell(view):
        command = act(view)
        steps.append(made.explanation())
        return command

    navigator.act = tell
    job = task(world, goal=goal, time_limit=time_limit)
    return run_episode(
        job, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(seed)
    ), steps


def test_it_tells_the_planner_the_fastest_way():
    way = guide().guide(observation((4.0, 0.0))).way
    assert np.abs(way[:, 1]).max() < 0.3
    assert (np.diff(way[:, 0]) > 0.0).all()
    assert 3.0 < way[-1, 0] < 4.2


def looks(world, robot=None, steps=8):
    """Observations of a robot that turns and drives past obstacles."""
    simulator = FastSimulator(load_settings("sim/fast"), robot or stage())
    seen = [simulator.reset(task(world), np.random.default_rng(0))]
    return [*seen, *(simulator.step(Twist(0.4, 0.5 if k < 3 else -0.2)) for k in range(steps))]


@pytest.mark.parametrize("target", [(4.0, 0.0), (3.0, 2.0), (1.0, 2.0)])
def test_lme_plus_picks_the_target_in_the_open(target):
    chosen = guide().guide(observation(target))
    assert chosen.subgoal == pytest.approx(target, abs=0.35)  # the turn may favour a near one
    assert not chosen.blocked
    assert len(chosen.points) == 0


def test_a_far_target_is_approached_on_a_straight_line():
    subgoal = guide().guide(observation((30.0, 0.0))).subgoal
    assert abs(math.atan2(subgoal[1], subgoal[0])) < 0.15
    assert subgoal[0] > 1.0


def test_lme_plus_leaves_a_dead_end():
    assert drive(DEAD_END)[0].outcome is Outcome.SUCCESS


def test_lme_plus_finds_reachable_places_when_enclosed():
    robot = stage()
    seen = FastSimulator(load_settings("sim/fast"), robot).reset(
        task(room(3.0), goal=(6.0, 0.0)), np.random.default_rng(0)
    )
    made = guide(robot)
    chosen = made.guide(seen)
    assert np.abs(chosen.subgoal).max() < 1.5
    assert not chosen.blocked
    assert np.isfinite(made.explanation().features).all()


def test_without_memory_lme_plus_knows_only_the_current_scan():
    robot = without_errors(shipped("jackal"))
    kept, forgetful = guide(robot), guide(robot, parts={"memory": False})
    for view in looks(CLUTTER, robot):
        known, scan_alone = (len(made.guide(view).points) for made in (kept, forgetful))
        assert scan_alone <= known
        assert scan_alone <= len(forgetful.explanation().view.points)
    assert scan_alone < known  # a disc came into the blind arc


def test_what_was_learned_of_the_ways_to_another_target_is_forgotten():
    other, straight = guide(), guide()
    for target in ((-30.0, 0.0), (30.0, 0.0)):
        other.guide(observation(target=target))
    straight.guide(observation(target=(30.0, 0.0)))
    assert other.sight.field.robot_time == straight.sight.field.robot_time


def test_a_seed_decides_everything():
    one, two, other = guide(seed=3), guide(seed=3), guide(seed=4)
    views = looks(CLUTTER)
    for view in views:
        assert_same(one.guide(view), two.guide(view))
        assert_same(one.explanation(), two.explanation())
        other.guide(view)
    assert not np.array_equal(other.explanation().candidates, one.explanation().candidates)


def test_a_mirrored_scene_has_mirrored_criteria(monkeypatch):
    # Cells do not mirror, so times may differ by what a cell takes; the other criteria may not.
    robot = stage()
    draw = lme.guides.lme_plus.guide.sample
    one, other = (guide(robot, parts={"structured": False}) for _ in range(2))
    mirrored = World(circles=CLUTTER.circles * [1, -1, 1], segments=CLUTTER.segments * [1, -1, 1, -1])
    simulators = [FastSimulator(load_settings("sim/fast"), robot) for _ in range(2)]
    seen = [
        simulator.reset(task(world, goal=goal), np.random.default_rng(0))
        for simulator, world, goal in zip(
            simulators, (CLUTTER, mirrored), ((4.0, 0.7), (4.0, -0.7)), strict=True
        )
    ]
    for omega in (0.0, 0.5, -0.3):
        one.guide(seen[0])
        with monkeypatch.context() as patch:
            patch.setattr(lme.guides.lme_plus.guide, "sample", lambda *given: draw(*given) * FLIP)
            other.guide(seen[1])
        why, mirror = one.explanation(), other.explanation()
        assert mirror.candidates == pytest.approx(why.candidates * FLIP, abs=KERNEL)
        for name, row, flipped in zip(why.names, why.features, mirror.features, strict=True):
            if name == "a_rest":
                assert flipped == pytest.approx(row, abs=MIRROR_TIME)
            elif name == "a_dev":  # the direction in which T falls changes from cell to cell
                assert (np.abs(flipped - row) > MIRROR_TURN).mean() < 0.1
            else:
                assert (np.abs(flipped - row) > 1e-3).sum() <= 1, name  # a way that just clears
        seen = [
            simulator.step(Twist(0.4, side * omega))
            for simulator, side in zip(simulators, (1, -1), strict=True)
        ]


def test_a_zigzag_is_driven_through_and_every_decision_has_its_names_and_its_reason():
    episode, steps = drive(ZIGZAG)
    assert episode.outcome is Outcome.SUCCESS
    before = None
    for now in steps:
        assert now.names == tuple(CRITERIA)
        assert now.features.shape == (len(CRITERIA), len(now.candidates))
        bearings = np.arctan2(*now.view.points.T[::-1])
        assert (np.diff(bearings) >= 0.0).all()  # as the sectors need them
        text = reason(now, before)
        verdict = "switched: " if now.decision.choice.switched else "kept: "
        assert text.startswith(verdict if before else "first subgoal: the best of")
        before = now
    told = reasons(steps)
    assert told[0][0] == 0
    assert told[-1][1] == len(steps) - 1
    assert {now.decision.choice for now in steps} >= {Choice.FIRST, Choice.KEPT}


def test_there_is_nothing_to_explain_before_the_first_decision():
    made = guide(parts={"random": False})
    assert made.explanation() is None
    made.guide(observation())
    assert (
        len(made.explanation().candidates) > 1
    )  # the target and places on the fastest way are candidates, too
    made.reset(np.random.default_rng(0))
    assert made.explanation() is None
