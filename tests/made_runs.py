"""Runs for tests, written as a command writes them, without driving."""

import numpy as np

from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.records.episode_record import EpisodeResult
from runners.records.launch_record import launch_of
from runners.records.records import RecordWriter
from tests.builders import episode_record


def write_run(run_dir, subset="lab100", worlds=(200, 201), job=None, command="eval", **columns):
    """Records of a run whose world 201 was a collision."""
    trajectory = np.random.default_rng(0).normal(size=(20, len(TRAJECTORY_COLUMNS)))
    with RecordWriter(run_dir) as writer:
        for world in worlds:
            outcome = "collision" if world == 201 else "success"
            record = episode_record(world, outcome=outcome, subset=subset, **columns)
            writer.append(EpisodeResult(record, trajectory))
        writer.merge()
    if job is not None:
        launch_of(command, [job], [], False, None).write(run_dir)
