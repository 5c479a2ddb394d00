"""Recognises recordings that `lme eval record=mcap` wrote. They contain the config and the seed."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np

from lme.errors import InputError
from lme.navigator import MapReader, Navigator
from runners.config import build
from runners.config.schema import RecordedConfig
from runners.records.launch_record import recorded_config
from runners.replay.bags import Bag
from runners.workers.episodes import episode_rng

TOPIC, TYPE = "/lme", "std_msgs/msg/String"
GOAL = "/goal"
GROUPS = ("robot", "guide", "planner")


class SimulatedEpisode(NamedTuple):
    """The simulated episode of a recording. config: of the evaluation."""

    seed: int
    world: int
    run: int
    config: RecordedConfig

    def rng(self) -> np.random.Generator:
        """The random generator of the navigator, spawned as in the episode."""
        return episode_rng(self.seed, self.world, self.run).spawn(2)[0]

    def read_map(self, navigator: Navigator) -> None:
        """Give the true map to a guide that reads it."""
        if isinstance(navigator.guide, MapReader):
            task = build.map_set(self.config, [self.world]).task(self.world)
            navigator.read_map(task.world, task.start)


def episode_of(bag: Bag) -> SimulatedEpisode | None:
    """The simulated episode of a recording; None for a real robot. Raises InputError if its data are not valid."""
    if not any(topic.name == TOPIC and TYPE in topic.types for topic in bag.topics()):
        return None
    text = next((message.content.data for message in bag.messages([TOPIC])), "")
    try:
        about = json.loads(text)
        seed, world, run = (int(about[name]) for name in ("seed", "world", "run"))
        return SimulatedEpisode(seed, world, run, recorded_config(about["config"]))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            f"bag {bag.path}: {TOPIC} does not say which episode this is: set as_recorded=false"
        ) from error
