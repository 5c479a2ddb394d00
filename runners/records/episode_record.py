"""Record of one episode. The fields are the columns of `episodes.parquet`, in the order of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from lme.types import Floats

CUSTOM_SUBSET = "custom"  # instead of the name of a subset, where the config names the worlds


@dataclass(frozen=True, slots=True, order=True)
class EpisodeKey:
    """An episode of a run: the number of its world, and its number among the episodes in that world."""

    world: int
    run: int

    def __str__(self) -> str:
        return f"world {self.world}, run {self.run}"

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the key of a row of `episodes.parquet` or `trajectories.parquet`."""
        return cls(int(row["world"]), int(row["run"]))


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLabels:
    """Columns that name what was run; they are the same in all episodes of a run.

    people: the people that the system sees: truth, tracked or none.
    subset: that of the map's worlds; CUSTOM_SUBSET if the config names the worlds, empty for a map without subsets.
    """

    system: str
    guide: str
    planner: str
    global_map: str
    ablation: str
    weights: str
    robot: str
    map: str
    subset: str
    people: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeRecord(RunLabels):
    """One row of `episodes.parquet`. `docs/records.md` explains each column.

    world_measures: the map set's measures of the world; each is a column `world_NAME`. social: measures of a world with
    people; each is a column. Records of other worlds have no such columns.
    """

    world: int
    run: int
    seed: int
    outcome: str
    time_s: float
    optimal_time_s: float
    barn_metric: float
    path_length_m: float
    shortest_path_length_m: float
    spl: float
    steps: int
    switches: int
    no_free_candidate: int
    mean_abs_domega_radps: float
    min_clearance_m: float
    final_distance_m: float
    last_minute_m: float
    reversals: int
    collision_in_reverse: int
    start_x_m: float
    start_y_m: float
    start_yaw_rad: float
    goal_x_m: float
    goal_y_m: float
    goal_tolerance_m: float
    decision_us_p50: float
    decision_us_p99: float
    wall_s: float
    world_measures: Mapping[str, Any] = field(default_factory=dict)
    social: Mapping[str, float] = field(default_factory=dict)

    @property
    def key(self) -> EpisodeKey:
        """Key of the episode."""
        return EpisodeKey(self.world, self.run)

    def columns(self) -> dict[str, Any]:
        """Return the row by column name."""
        row = {name: getattr(self, name) for name in COLUMNS}
        return (
            row | {f"world_{name}": value for name, value in self.world_measures.items()} | dict(self.social)
        )


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """Result that a worker returns for one episode. trajectory: (T, 10), see `lme.navigation.episode.Episode`."""

    record: EpisodeRecord
    trajectory: Floats


KEY_COLUMNS = tuple(column.name for column in fields(EpisodeKey))
COLUMNS = tuple(
    column.name for column in fields(EpisodeRecord) if column.name not in ("world_measures", "social")
)
TEXTS = tuple(column.name for column in fields(EpisodeRecord) if column.type == "str")
