"""How much a run was planned to drive, from its launch record: a killed run has driven less."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lme.errors import InputError
from runners.records.launch_record import Launch

if TYPE_CHECKING:
    import pandas as pd

WORLDS, EPISODES = "planned_worlds", "planned_episodes"  # columns, the same in all episodes of a run


def planned_columns(launch: Launch) -> dict[str, int]:
    """The numbers of worlds and episodes that a run was planned to drive; {} if its map can no longer be built."""
    if launch.command != "eval":
        return {}
    from runners.config import build

    try:
        worlds = len(build.map_set(launch.config).numbers)
    except InputError:
        return {}
    return {WORLDS: worlds, EPISODES: worlds * int(launch.configs[0]["runs"])}


def planned(episodes: pd.DataFrame, column: str) -> int:
    """The number that the runs of these episodes were planned to drive in total; 0 if no run says."""
    if column not in episodes:
        return 0
    runs = episodes.drop_duplicates("run_dir") if "run_dir" in episodes else episodes.iloc[:1]
    return int(runs[column].sum())
