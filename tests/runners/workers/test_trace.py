"""The trace of a rerun: the same episode to the last bit, each decision with its explanation."""

import numpy as np
import pytest

from lme.guides.lme.guide import Lme
from lme.navigation.episode import run_episode
from runners.config import build
from runners.workers.episodes import episode_rng
from runners.workers.trace import rerun
from tests.composing import jobs_of

CLUTTERED = ["robot=turtlebot2", "map=real1_dynamic", "map.time_limit=3"]


class Mapped(Lme):
    """A guide made from LME that takes the map, too, and heeds only every other subgoal."""

    Config = Lme.Config

    def reset(self, rng):
        super().reset(rng)
        self.step = 0

    def read_map(self, world, start):
        self.known = len(world.edges)

    def guide(self, observation):
        assert self.known > 0
        self.step += 1
        if self.step % 2:
            self.last = super().guide(observation)
        return self.last


class Own:
    """A custom guide that is not LME, but can explain itself."""

    Config = Lme.Config

    def __init__(self, config, robot):
        self.inner = Lme(config, robot)

    def reset(self, rng):
        self.inner.reset(rng)

    def guide(self, observation):
        return self.inner.guide(observation)

    def explanation(self):
        return self.inner.explanation()


@pytest.fixture(scope="module")
def composed():
    with jobs_of("eval", *CLUTTERED) as job:
        yield lambda *words: job(*words).config


def driven(config, world):
    """The episode without an observer."""
    navigator, simulator = build.navigator(config), build.simulator(config)
    return run_episode(build.map_set(config).task(world), navigator, simulator, episode_rng(0, world, 0))


NOISE = ["sim.scan_noise=0.02", "sim.goal_noise=0.1", "sim.slip=0.1", "sim.latency=0.2"]


@pytest.mark.parametrize("guide", [Lme, Mapped])
@pytest.mark.parametrize("words", [[], ["sim=physics"], NOISE])
def test_the_rerun_episode_is_the_driven_one(composed, words, guide):
    config = composed(*words)
    config.guide["_target_"] = f"{guide.__module__}.{guide.__name__}"
    trace = rerun(config, 0, 0)
    np.testing.assert_array_equal(trace.episode.trajectory, driven(config, 0).trajectory)
    assert len(trace.steps) == trace.episode.steps > 10
    for step in trace.steps:
        if step.explanation is not None:
            np.testing.assert_array_equal(step.explanation.decision.subgoal, step.guidance.subgoal)
            assert step.explanation.decision.choice.switched == step.guidance.switched


def test_a_guide_made_from_lme_is_explained_where_it_asks(composed):
    config = composed()
    config.guide["_target_"] = f"{__name__}.Mapped"
    asked = [step.explanation is not None for step in rerun(config, 0, 0).steps]
    assert asked == [step % 2 == 0 for step in range(len(asked))]


def test_a_guide_of_ones_own_is_explained_where_it_can_be(composed):
    config = composed()
    config.guide["_target_"] = f"{__name__}.Own"
    steps = rerun(config, 0, 0).steps
    assert len(steps) > 10
    for step in steps:
        np.testing.assert_array_equal(step.explanation.decision.subgoal, step.guidance.subgoal)


def test_a_trace_of_another_guide_has_no_reasons(composed):
    trace = rerun(composed("guide=target"), 0, 0)
    assert all(step.explanation is None for step in trace.steps)


def test_movers_stand_at_each_step_as_they_did_then(composed):
    trace = rerun(composed("map=dynabarn", "map.time_limit=1"), 0, 0)
    still = len(trace.task.world.circles)
    places = {tuple(step.obstacles[0][still:].ravel()) for step in trace.steps}
    assert len(places) == len(trace.steps)
