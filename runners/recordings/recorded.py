"""Recognition of recordings that lme wrote with `record=mcap`. They contain the config and the seed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.inputs.guarded_file import decode_json
from lme.navigation.navigator import MapReader, Navigator
from runners.config import build
from runners.config.schema import RecordedConfig
from runners.recordings.bags import EPISODE, Bag
from runners.records.launch_record import read_launch, recorded_config
from runners.records.trust import UntrustedError
from runners.workers.episodes import episode_rng
from runners.workers.recorder import WANTED

GOAL, ODOM, SCAN, SENT = "/goal", "/odom", "/scan", "/cmd_vel"
GROUPS = ("robot", "guide", "planner", "filter")


class RecordedEpisode(NamedTuple):
    """An episode of `lme eval`, or a drive of `lme live` to one goal, whose number is then `world`.

    config: of the command. scan: the geometry of every scan, as in `LaserScan`. goal_tolerance: of a drive of `lme
    live` [m]; None for an episode.
    """

    seed: int
    world: int
    run: int
    config: RecordedConfig
    scan: dict[str, float]
    goal_tolerance: float | None

    @property
    def live(self) -> bool:
        """Return whether this is a drive of `lme live`."""
        return self.goal_tolerance is not None

    @property
    def command(self) -> str:
        """Return the topic of the planner's commands.

        The commands that `lme live` sends are limited, and zero while the robot must stop.
        """
        return WANTED if self.live else "/cmd_vel"

    def __str__(self) -> str:
        if self.live:
            return f"goal {self.world}, seed {self.seed} of lme live"
        return f"world {self.world}, run {self.run}, seed {self.seed} of lme eval"

    def rng(self) -> np.random.Generator:
        """Return the random generator of the navigator, spawned as in the episode."""
        return episode_rng(self.seed, self.world, self.run).spawn(2)[0]

    def read_map(self, navigator: Navigator) -> None:
        """Give the true map to a guide that reads it, if the episode had one."""
        if isinstance(navigator.guide, MapReader) and not self.live:
            task = build.map_set(self.config, [self.world]).task(self.world)
            navigator.read_map(task.world, task.start)


def episode_of(bag: Bag) -> RecordedEpisode | None:
    """Return the episode if lme wrote the recording, else None. Raises InputError if its data are invalid."""
    if not bag.by_lme:
        return None
    text = next((message.content.data for message in bag.messages([EPISODE])), "")
    try:
        metadata = decode_json(text)
        seed, world, run = (int(metadata[name]) for name in ("seed", "world", "run"))
        scan, tolerance = dict(metadata["scan"]), metadata.get("goal_tolerance")
        return RecordedEpisode(seed, world, run, _config(bag.path, metadata["config"]), scan, tolerance)
    except UntrustedError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            f"bag {bag.path}: {EPISODE} does not say which episode this is: set as_recorded=false"
        ) from error


def _config(path: Path, values: dict[str, Any]) -> RecordedConfig:
    """Return the config in a recording. The files that it names are copies in the run that holds the recording."""
    launches = (read_launch(folder) for folder in (path.parent, path.parent.parent))
    run = next((launch for launch in launches if launch is not None), None)
    return recorded_config(values, path.parent, [] if run is None else run.inputs)
