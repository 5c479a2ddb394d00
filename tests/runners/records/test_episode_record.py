"""A record's fields are the columns of `episodes.parquet`, in their order."""

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pyarrow.parquet as pq
import pytest

from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.records.episode_record import (
    COLUMNS,
    KEY_COLUMNS,
    EpisodeKey,
    EpisodeRecord,
    EpisodeResult,
)
from runners.records.parquet import EPISODES, TRAJECTORIES
from runners.records.records import RecordWriter
from tests.builders import episode_record
from tests.places import ROOT


@pytest.fixture
def written(tmp_path):
    """A run of one episode."""
    record = episode_record(5, world_measures={"fill": np.float64(0.25), "cylinders": 7})
    with RecordWriter(tmp_path) as writer:
        writer.append(EpisodeResult(record, np.zeros((3, len(TRAJECTORY_COLUMNS)))))
        writer.merge()
    return tmp_path


def test_every_field_is_a_column_and_every_column_a_field(written):
    names = pq.read_schema(written / EPISODES).names
    known = [field.name for field in fields(EpisodeRecord) if field.name not in ("world_measures", "social")]
    assert names == [*known, "world_cylinders", "world_fill"]


def test_the_types_of_the_columns_are_those_of_the_fields(written):
    kinds = {"str": "string", "int": "int64", "float": "double"}
    schema = pq.read_schema(written / EPISODES)
    for field in fields(EpisodeRecord):
        if field.name in COLUMNS and field.type != "float":  # a float may be a whole number in this record
            assert str(schema.field(field.name).type) == kinds[field.type], field.name
    assert str(schema.field("world_fill").type) == "double"


def test_a_trajectory_has_a_row_per_step(written):
    steps = pq.read_table(written / TRAJECTORIES)
    assert steps.column_names == [*KEY_COLUMNS, "step", *TRAJECTORY_COLUMNS]
    assert steps["step"].to_pylist() == [0, 1, 2]


def test_a_key_is_ordered_by_world_and_then_by_run():
    keys = [EpisodeKey(3, 0), EpisodeKey(2, 1), EpisodeKey(2, 0)]
    assert sorted(keys) == keys[::-1]
    assert len({*keys, EpisodeKey(3, 0)}) == 3
    assert str(keys[0]) == "world 3, run 0"
    assert EpisodeKey.of({"world": np.int64(3), "run": 0, "seed": 1}) == keys[0]
    with pytest.raises(FrozenInstanceError):
        keys[0].world = 4


def test_every_column_is_documented():
    text = (ROOT / "docs" / "reference" / "records.md").read_text(encoding="utf-8")
    undocumented = [name for name in (*COLUMNS, "step", *TRAJECTORY_COLUMNS) if f"`{name}`" not in text]
    assert undocumented == []
