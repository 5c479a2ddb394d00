"""How much a run was planned to drive, from its launch record: a killed run has driven less."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runners.records.launch_record import Launch

if TYPE_CHECKING:
    import pandas as pd

WORLDS, EPISODES = "planned_worlds", "planned_episodes"  # columns, the same in all episodes of a run


def planned_columns(launch: Launch) -> dict[str, int]:
    """The numbers of worlds and episodes that a run was planned to drive; {} if its record does not say."""
    runs = launch.configs[0].get("runs")
    if launch.command != "eval" or not launch.worlds or not isinstance(runs, int):
        return {}
    return {WORLDS: launch.worlds[0], EPISODES: launch.worlds[0] * runs}


def planned(episodes: pd.DataFrame, column: str) -> int:
    """The number that the runs of these episodes were planned to drive in total; 0 if no run says."""
    if column not in episodes:
        return 0
    runs = episodes.drop_duplicates("run_dir") if "run_dir" in episodes else episodes.iloc[:1]
    return int(runs[column].sum())
