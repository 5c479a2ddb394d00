"""GlobalPlanner's costs, and the inflation that grows with the speed."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.global_path import GlobalPlanner
from lme.simulation.fast import FastSimulator
from lme.types import Twist
from lme.worlds.world import World
from tests.builders import shipped, task

JACKAL = shipped("jackal")
POST = World(circles=np.array([[2.0, 0.0, 0.1]]))


def guide(**settings):
    made = GlobalPlanner(load_settings("guide/global_planner", **settings), JACKAL)
    made.reset(np.random.default_rng(0))
    return made


def raised(v):
    """Cells that cost something around a post, at a speed [m/s]."""
    made = guide()
    view = FastSimulator(load_settings("sim/fast"), JACKAL).reset(task(POST), np.random.default_rng(0))
    made.guide(view._replace(twist=Twist(v, 0.0)))
    return int((made.costmap.costs > 0).sum())


def test_cells_cost_what_they_cost_in_global_planner():
    paid = guide().cell_costs
    assert paid[[0, 10, 67, 68, 251]].tolist() == [50.0, 80.0, 251.0, 252.0, 252.0]
    assert np.isinf(paid[252:]).all()


def test_inflation_grows_with_the_speed_up_to_its_greatest():
    at_rest, slow, fast, faster = (raised(v) for v in (0.0, 0.75, 1.5, 2.0))
    assert at_rest < slow < fast == faster
    assert raised(-0.5) == at_rest


def test_the_path_keeps_farther_away_than_navfns():
    view = FastSimulator(load_settings("sim/fast"), JACKAL).reset(task(POST), np.random.default_rng(0))
    view = view._replace(twist=Twist(1.5, 0.0))
    near = guide(cost_factor=0.8, fast_inflation_radius=0.3).guide(view).path
    far = guide().guide(view).path
    assert np.abs(far[:, 1]).max() > np.abs(near[:, 1]).max() + 0.05


@pytest.mark.parametrize("changes", [{"neutral_cost": 0.0}, {"lethal_cost": 50.0}, {"full_speed": 0.0}])
def test_a_wrong_value_is_named(changes):
    with pytest.raises(InputError, match=rf"guide\.{next(iter(changes))} is "):
        guide(**changes)
