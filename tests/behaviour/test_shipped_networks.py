"""The networks that ship with lme."""

import numpy as np
import pytest
import yaml

from lme.guides.lme.weight_files import find_network, shipped_networks
from lme.navigation.episode import run_episode
from runners.config.build import map_set, navigator, simulator
from tests.composing import jobs_of

BYTES_MAX = 2**20


@pytest.mark.parametrize("name", shipped_networks())
def test_a_shipped_network_is_small_and_has_a_card(name):
    path = find_network(name)
    assert path.stat().st_size <= BYTES_MAX
    card = yaml.safe_load(path.with_suffix(".md").read_text().split("```")[1].removeprefix("yaml"))
    assert card["name"] == name
    if "source" in card:  # of others
        assert {"commit", "sha256", "licence"} <= set(card)
        assert "Permission is hereby granted" in (path.parent / card["notice"]).read_text()
    else:
        assert {"command", "seed", "versions", "validation", "held_out"} <= set(card)


@pytest.mark.parametrize(
    ("guide", "planner"),
    [("target", "dclp"), ("lme", "dclp"), ("learned_subgoal", "simple"), ("learned_subgoal", "dclp")],
)
def test_the_default_network_drives_to_the_goal(guide, planner):
    words = (f"planner={planner}", f"guide={guide}", "map.subset=fresh", "map.count=1", "map.fresh_seed=7")
    with jobs_of("eval", *words) as job:
        config = job().config
        task = map_set(config).task(1000)
        episode = run_episode(task, navigator(config), simulator(config), np.random.default_rng(0))
    assert episode.outcome == "success"
