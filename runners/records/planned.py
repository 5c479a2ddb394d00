"""How much a run was to drive, from its launch record: a killed run has driven less."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lme.errors import InputError
from runners.records.launch_record import Launch

if TYPE_CHECKING:
    import pandas as pd

WORLDS, EPISODES = "planned_worlds", "planned_episodes"  # columns, the same in all episodes of a run


def planned_columns(launch: Launch) -> dict[str, int]:
    """The numbers of worlds and of episodes that a run was to drive; {} if its map cannot be built any more."""
    if launch.command != "eval":
        return {}
    from runners.config import build

    try:
        worlds = len(build.map_set(launch.config).numbers)
    except InputError:
        return {}
    return {WORLDS: worlds, EPISODES: worlds * int(launch.configs[0]["runs"])}


def planned(episodes: pd.DataFrame, column: str) -> int:
    """The number that the runs of these episodes were to drive together; 0 if no run tells."""
    if column not in episodes:
        return 0
    runs = episodes.drop_duplicates("run_dir") if "run_dir" in episodes else episodes.iloc[:1]
    return int(runs[column].sum())
