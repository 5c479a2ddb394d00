"""Records survive kills, full disks and resumption, and come back exactly as they went in."""

import base64
import json
import math
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.records import episode_record as log_module
from runners.records import parquet
from runners.records.episode_record import EpisodeKey, EpisodeKeys, EpisodeResult
from runners.records.launch_record import LAUNCH, Launch, read_launch
from runners.records.parquet import EPISODES, TRAJECTORIES
from runners.records.records import (
    PLANNED_EPISODES,
    PLANNED_WORLDS,
    RecordsWriteError,
    RecordWriter,
    find_runs,
    planned,
    read_episodes,
    read_first,
    read_runs,
    read_trajectories,
)
from tests.builders import episode_record
from tests.places import ROOT

KEYS = [EpisodeKey(world, run) for world in (200, 3, 77) for run in (1, 0)]


def episode(key, **changes):
    """A result that depends on the key alone."""
    rng = np.random.default_rng([key.world, key.run])
    columns = {
        "time_s": rng.normal(),
        "min_clearance_m": math.nan if key.run else rng.normal(),
        "wall_s": rng.normal(),
        "world_measures": {} if key.world == 3 else {"fill": rng.normal()},
        **changes,
    }
    trajectory = rng.normal(size=(int(rng.integers(1, 9)), len(TRAJECTORY_COLUMNS)))
    return EpisodeResult(episode_record(key.world, key.run, **columns), trajectory)


def write(run_dir, keys, merge=True):
    with RecordWriter(run_dir) as writer:
        for key in keys:
            writer.append(episode(key))
        if merge:
            writer.merge()


def contents(run_dir):
    return [(run_dir / name).read_bytes() for name in (EPISODES, TRAJECTORIES)]


@pytest.mark.parametrize("merge", [False, True])
def test_one_record_is_read_without_the_others(tmp_path, merge):
    write(tmp_path, KEYS, merge)
    record = read_first(tmp_path)
    assert EpisodeKey.of(record) in KEYS
    assert record["people"] == read_episodes([tmp_path])["people"].iloc[0]


def test_equal_texts_are_held_once(tmp_path):
    """A million episodes have twenty texts each."""
    write(tmp_path, KEYS)
    frame = read_episodes([tmp_path])
    for column in ("system", "outcome", "run_dir"):
        assert len({id(text) for text in frame[column]}) == 1


@pytest.mark.parametrize("merge", [False, True])
def test_records_are_read_back_exactly(tmp_path, merge):
    write(tmp_path, KEYS, merge)
    frame, steps = read_episodes([tmp_path]), read_trajectories([tmp_path])
    assert list(map(EpisodeKey.of, frame.to_dict("records"))) == sorted(KEYS)
    for key in KEYS:
        result = episode(key)
        row = frame[(frame["world"] == key.world) & (frame["run"] == key.run)].iloc[0]
        assert row["time_s"] == result.record.time_s
        assert math.isnan(row["min_clearance_m"]) == math.isnan(result.record.min_clearance_m)
        assert math.isnan(row["world_fill"]) == (not result.record.world_measures)
        path = steps[(steps["world"] == key.world) & (steps["run"] == key.run)]
        assert path["step"].tolist() == list(range(len(path)))
        np.testing.assert_array_equal(path[list(TRAJECTORY_COLUMNS)].to_numpy(), result.trajectory)


def test_an_appended_episode_is_on_disk_before_the_file_is_closed(tmp_path):
    with RecordWriter(tmp_path) as writer:
        writer.append(episode(EpisodeKey(5, 0)))
        assert len(read_episodes([tmp_path])) == 1


def test_merge_leaves_two_files_and_resuming_a_complete_run_changes_nothing(tmp_path):
    write(tmp_path, KEYS)
    before = contents(tmp_path), [(tmp_path / name).stat().st_mtime_ns for name in (EPISODES, TRAJECTORIES)]
    with RecordWriter(tmp_path) as writer:
        assert set(writer.done()) == set(KEYS)
        writer.append(episode(KEYS[0], outcome="collision"))
        writer.merge()
    after = contents(tmp_path), [(tmp_path / name).stat().st_mtime_ns for name in (EPISODES, TRAJECTORIES)]
    assert before == after
    assert sorted(path.name for path in tmp_path.iterdir()) == [EPISODES, TRAJECTORIES]


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.permutations(KEYS),
    st.integers(0, 6),
    st.booleans(),
    st.binary(min_size=1, max_size=40),
    st.sampled_from([1, 9, 1000]),
)
def test_a_killed_and_resumed_run_gives_the_identical_files(
    tmp_path_factory, monkeypatch, order, cut, merged, torn, block
):
    for limit in ("_BLOCK_STEPS", "_GROUP_ROWS", "_BATCH"):
        monkeypatch.setattr(parquet, limit, block)
    straight, resumed = tmp_path_factory.mktemp("straight"), tmp_path_factory.mktemp("resumed")
    write(straight, KEYS)
    write(resumed, order[:cut], merge=merged)
    parts = resumed / "parts" / "episodes.jsonl"
    if parts.is_file():
        with parts.open("ab") as file:
            file.write(torn.replace(b"\n", b"{"))  # the beginning of a line
    with RecordWriter(resumed) as writer:
        assert set(writer.done()) == set(order[:cut])
        for key in order[cut:]:
            writer.append(episode(key))
        writer.merge()
    assert contents(straight) == contents(resumed)


@pytest.mark.parametrize("rows", [1, 2, 4])
def test_a_merge_in_small_pieces_gives_the_same_records(tmp_path, monkeypatch, rows):
    """The columns of all row groups are known before the first one is written."""
    whole, pieces = tmp_path / "whole", tmp_path / "pieces"
    write(whole, KEYS)
    monkeypatch.setattr(parquet, "_GROUP_ROWS", rows)
    monkeypatch.setattr(parquet, "_BATCH", rows)
    write(pieces, KEYS[:4])
    write(pieces, KEYS[4:])
    with pq.ParquetFile(pieces / EPISODES) as file:
        assert file.num_row_groups == -(-len(KEYS) // rows)
        assert file.schema_arrow.equals(pq.read_schema(whole / EPISODES))
    for name in (EPISODES, TRAJECTORIES):
        pd.testing.assert_frame_equal(*(pd.read_parquet(folder / name) for folder in (pieces, whole)))
    frames = (read_episodes([folder]).drop(columns="run_dir") for folder in (pieces, whole))
    pd.testing.assert_frame_equal(*frames)


def test_records_without_steps_are_merged_again(tmp_path, monkeypatch):
    monkeypatch.setattr(parquet, "_BATCH", 2)
    write(tmp_path, KEYS)
    (tmp_path / TRAJECTORIES).unlink()
    before = read_episodes([tmp_path])
    write(tmp_path, [EpisodeKey(5, 0)])
    after = read_episodes([tmp_path])
    assert set(map(EpisodeKey.of, read_trajectories([tmp_path]).to_dict("records"))) == {EpisodeKey(5, 0)}
    pd.testing.assert_frame_equal(after[after["world"] != 5].reset_index(drop=True), before)


def test_a_set_of_keys_holds_each_once_in_order():
    keys = EpisodeKeys.of([EpisodeKey(7, 2**31), EpisodeKey(3, 1), EpisodeKey(3, 0), EpisodeKey(3, 1)])
    assert list(keys) == [EpisodeKey(3, 0), EpisodeKey(3, 1), EpisodeKey(7, 2**31)]
    assert len(keys) == 3
    assert EpisodeKey(7, 2**31) in keys
    assert EpisodeKey(7, 1) not in keys
    assert EpisodeKey(8, 0) not in keys
    assert (3, 0) not in keys


def test_columns_that_are_not_needed_are_not_read(tmp_path):
    write(tmp_path, KEYS[:3])
    write(tmp_path, KEYS[3:], merge=False)
    (frame,) = read_runs([tmp_path], {"time_s", "world_fill"})
    pd.testing.assert_frame_equal(frame, read_episodes([tmp_path]).drop(columns=["time_s", "world_fill"]))


def test_steps_are_stored_in_blocks_of_whole_episodes_and_read_by_episode(tmp_path, monkeypatch):
    monkeypatch.setattr(parquet, "_BLOCK_STEPS", 1)
    write(tmp_path, KEYS)
    with pq.ParquetFile(tmp_path / TRAJECTORIES) as file:
        assert file.num_row_groups == len(KEYS)
    every = read_trajectories([tmp_path])
    write(tmp_path, [EpisodeKey(5, 0), EpisodeKey(6, 0)], merge=False)
    wanted = [KEYS[0], KEYS[3], EpisodeKey(6, 0), EpisodeKey(8, 8)]
    steps = read_trajectories([tmp_path], wanted)
    assert set(map(EpisodeKey.of, steps.to_dict("records"))) == set(wanted[:3])
    for key in wanted[:2]:
        same = [frame[(frame["world"] == key.world) & (frame["run"] == key.run)] for frame in (steps, every)]
        pd.testing.assert_frame_equal(*[part.reset_index(drop=True) for part in same])


def test_a_line_without_end_is_refused_before_it_fills_the_memory(tmp_path, monkeypatch, says):
    monkeypatch.setattr(log_module, "_LINE_BYTES", 1000)
    monkeypatch.setattr(log_module, "_FOREIGN_BYTES", 1000)
    monkeypatch.setattr(log_module, "_BLOCK", 100)
    log = tmp_path / "episodes.jsonl"
    log.write_bytes(bytes(2000))
    with says.raises(InputError), log_module.read_log(log):
        pass
    with says.raises(InputError):
        log_module.cut_torn_line(log)
    assert log.stat().st_size == 2000


def test_a_torn_line_longer_than_a_block_is_cut(tmp_path, monkeypatch):
    monkeypatch.setattr(log_module, "_BLOCK", 7)
    log = tmp_path / "log"
    for whole in (b"", b"one\n", b"one\ntwo and more\n"):
        for torn in (b"", b"a", b"seven..", b"more than two blocks"):
            log.write_bytes(whole + torn)
            log_module.cut_torn_line(log)
            assert log.read_bytes() == whole


def test_killed_between_the_two_files_of_a_merge(tmp_path):
    """Whichever of the two Parquet files was replaced, parts still hold everything."""
    straight, killed = tmp_path / "straight", tmp_path / "killed"
    write(straight, KEYS)
    write(killed, KEYS, merge=False)
    for name in (TRAJECTORIES, EPISODES):
        (killed / name).write_bytes((straight / name).read_bytes())
        assert len(read_episodes([killed])) == len(KEYS)
        assert len(read_trajectories([killed])) == len(read_trajectories([straight]))
    write(killed, [])
    assert contents(killed) == contents(straight)


def test_the_first_record_of_an_episode_wins(tmp_path):
    with RecordWriter(tmp_path) as writer:
        writer.append(episode(EpisodeKey(1, 0)))
        writer.append(episode(EpisodeKey(1, 0), outcome="collision"))
        writer.merge()
    assert read_episodes([tmp_path])["outcome"].tolist() == ["success"]


def test_numpy_scalars_are_welcome(tmp_path):
    measures = {"fill": np.float64(0.5), "cylinders": np.int64(7), "open": np.True_}
    with RecordWriter(tmp_path) as writer:
        writer.append(episode(EpisodeKey(1, 0), world_measures=measures, steps=np.int64(7)))
        writer.merge()
    row = read_episodes([tmp_path]).iloc[0]
    assert (row["world_fill"], row["world_cylinders"], row["world_open"], row["steps"]) == (0.5, 7, True, 7)


def test_the_append_log_of_another_version_is_resumed(tmp_path):
    """With columns that this version does not know, and without some that it does."""
    arrays = {"x_m": np.array([0.1, 0.2]), "score": np.array([1, 2], dtype=np.float32)}
    encoded = {name: [a.dtype.str, base64.b64encode(a.tobytes()).decode()] for name, a in arrays.items()}
    record = {"system": "LME", "world": 1, "run": 0, "outcome": "timeout", "luck": 0.5}
    (tmp_path / "parts").mkdir()
    line = json.dumps({"record": record, "trajectory": encoded})
    (tmp_path / "parts" / "episodes.jsonl").write_text(f"{line}\n")
    with RecordWriter(tmp_path) as writer:
        assert set(writer.done()) == {EpisodeKey(1, 0)}
        writer.append(episode(EpisodeKey(2, 0)))
        writer.merge()
    frame, steps = read_episodes([tmp_path]), read_trajectories([tmp_path])
    assert frame["luck"][0] == 0.5
    assert frame["time_s"].isna().tolist() == [True, False]
    assert frame["people"].tolist() == ["truth", "truth"]
    assert list(frame.columns).index("wall_s") < list(frame.columns).index("luck")
    old = steps[steps["world"] == 1]
    assert old["x_m"].tolist() == [0.1, 0.2]
    assert old["score"].dtype == np.float32


@pytest.mark.parametrize("action", ["append", "merge"])
def test_a_run_whose_folder_is_deleted_meanwhile_says_so(tmp_path, action, says):
    run_dir = tmp_path / "run"
    with RecordWriter(run_dir) as writer:
        writer.append(episode(KEYS[0]))
        shutil.rmtree(run_dir)
        with says.raises(RecordsWriteError) as said:
            writer.append(episode(KEYS[1])) if action == "append" else writer.merge()
    assert "free some space" not in str(said.value)


SMALL_DISK = """
    import resource, sys
    from runners.records.records import RecordWriter, RecordsWriteError
    from tests.runners.records.test_records import KEYS, episode
    with RecordWriter(sys.argv[1]) as writer:
        writer.append(episode(KEYS[0]))
        size = (writer._run_dir / "parts/episodes.jsonl").stat().st_size
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 100, resource.RLIM_INFINITY))
        try:
            writer.ACTION
        except RecordsWriteError as error:
            print(error)
"""


@pytest.mark.parametrize("action", ["append(episode(KEYS[1]))", "merge()"])
def test_a_full_disk_keeps_what_was_there(tmp_path, action, says):
    script = textwrap.dedent(SMALL_DISK).replace("ACTION", action)
    process = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    says(process.stdout)
    assert len(process.stdout.splitlines()) == 1
    frame = read_episodes([tmp_path])
    assert list(map(EpisodeKey.of, frame.to_dict("records"))) == KEYS[:1]
    assert not list(tmp_path.glob(".*"))
    write(tmp_path, KEYS)
    write(tmp_path / "straight", KEYS)
    assert contents(tmp_path) == contents(tmp_path / "straight")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_device_without_space(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "episodes.jsonl").symlink_to("/dev/full")
    with RecordWriter(tmp_path) as writer, pytest.raises(RecordsWriteError, match="0 episodes are kept"):
        writer.append(episode(EpisodeKey(1, 0)))


def test_a_run_directory_has_one_writer(tmp_path, says):
    pytest.importorskip("fcntl")
    with RecordWriter(tmp_path), says.raises(InputError):
        RecordWriter(tmp_path).__enter__()
    write(tmp_path, KEYS)


def test_an_output_directory_that_cannot_be_made(tmp_path, says):
    (tmp_path / "file").write_text("")
    with says.raises(InputError):
        RecordWriter(tmp_path / "file" / "run").__enter__()


def test_runs_are_found_in_a_sweep_in_their_order(tmp_path):
    for number in (10, 9, 0):
        write(tmp_path / str(number), KEYS[:1])
    (tmp_path / "multirun.yaml").write_text("")
    assert [path.name for path in find_runs([tmp_path])] == ["0", "9", "10"]
    assert find_runs([tmp_path / "9", tmp_path]) == [tmp_path / name for name in ("9", "0", "10")]
    frame = read_episodes(find_runs([tmp_path]))
    assert frame["run_dir"].tolist() == [str(tmp_path / name) for name in ("0", "9", "10")]


def test_a_sweep_that_was_stopped_names_the_jobs_that_are_missing(tmp_path, says):
    config = {"seed": 0, "runs": 2}
    Launch("eval", "0", True, [], [config] * 3, num_jobs=3).write(tmp_path)
    for number in (0, 1, 2):
        write(tmp_path / str(number), KEYS[:1])
        if number == 1:
            with says.warns():
                find_runs([tmp_path])
    assert len(find_runs([tmp_path])) == 3  # the tests make errors of warnings


def test_config_keys_that_a_run_has_changed_become_columns(tmp_path):
    for name, kp, changes in (("a", 4.0, {}), ("b", 8.0, {"planner.kp": 8.0})):
        write(tmp_path / name, KEYS[:1])
        config = {"seed": 0, "runs": 2, "planner": {"kp": kp, "kd": 0.1}}
        launch = Launch("eval", "0", False, [], [config], [{"sim": "physics"}], [changes], num_worlds=3)
        launch.write(tmp_path / name)
    write(tmp_path / "c", KEYS[:1])  # tells of no config
    frame = read_episodes([tmp_path / name for name in "abc"]).fillna("")
    assert frame["planner.kp"].tolist() == ["4.0", "8.0", ""]
    assert frame["changes"].tolist() == ["", "planner.kp=8.0", ""]
    assert frame["sim"].tolist() == ["physics", "physics", ""]
    assert "planner.kd" not in frame
    frame = read_episodes([tmp_path / "a"])
    assert not [column for column in frame.columns if "." in column]


def test_the_planned_numbers_are_sums_over_runs(tmp_path):
    for name in "ab":
        write(tmp_path / name, KEYS[:1])
        Launch("eval", "0", False, [], [{"runs": 2}], num_worlds=3).write(tmp_path / name)
    frame = read_episodes([tmp_path / "a", tmp_path / "b"])
    assert (planned(frame, PLANNED_WORLDS), planned(frame, PLANNED_EPISODES)) == (6, 12)


def test_a_run_of_an_earlier_version_is_to_be_driven_again(tmp_path, says):
    write(tmp_path, KEYS[:1])
    Launch("eval", "0", False, [], [{"runs": 2}]).write(tmp_path)
    with says.raises(InputError):
        read_episodes([tmp_path])


def test_the_records_below_a_sweep_of_trainings_are_named(tmp_path, says):
    for training in "01":
        write(tmp_path / training / "env1", KEYS[:1])
    with says.raises(InputError):
        find_runs([tmp_path])
    write(tmp_path / "1" / "env2", KEYS[:1])
    with says.raises(InputError):
        find_runs([tmp_path])


def test_missing_and_garbage_files_are_named(tmp_path, says):
    with says.raises(InputError):
        find_runs([tmp_path / "nowhere"])
    with pytest.raises(InputError, match="has no records"):
        find_runs([tmp_path])
    with (
        RecordWriter(tmp_path),
        pytest.warns(UserWarning, match="left out"),
        pytest.raises(InputError, match="no finished episode"),
    ):
        read_episodes([tmp_path])
    parts = tmp_path / "parts" / "episodes.jsonl"
    write(tmp_path, KEYS[:1], merge=False)
    parts.write_bytes(b'{"record": []}\n' + parts.read_bytes())
    with says.raises(InputError):
        read_episodes([tmp_path])
    parts.unlink()
    (tmp_path / EPISODES).write_bytes(b"PAR1 but nothing else")
    with says.raises(InputError):
        read_episodes([tmp_path])


def test_a_footer_that_gives_a_column_another_type(tmp_path):
    """Reading the least and the greatest world of such a column would end the process."""
    write(tmp_path, KEYS)
    path = tmp_path / TRAJECTORIES
    whole = path.read_bytes()
    int64, byte_array = (
        b"\x15\x04\x19",
        b"\x15\x0c\x19",
    )  # the type of a column's chunk in Thrift's compact form
    assert int64 in whole
    path.write_bytes(whole.replace(int64, byte_array))
    with pytest.raises(
        InputError, match=r"trajectories\.parquet is not .*: row group 0 holds world as BYTE_ARRAY"
    ):
        read_trajectories([tmp_path], KEYS)


def test_a_parquet_file_of_something_else_is_refused(tmp_path, says):
    pd.DataFrame({"a": [1]}).to_parquet(tmp_path / EPISODES)
    with says.raises(InputError):
        read_episodes([tmp_path])
    pd.DataFrame({"world": [1], "run": [0]}).to_parquet(tmp_path / EPISODES)
    with says.raises(InputError):
        read_episodes([tmp_path])


@pytest.mark.parametrize(
    ("column", "value", "held"),
    [
        ("world", "x", ".*string"),
        ("run", None, "null"),
        ("run", 0.5, "double"),
        ("outcome", 1.0, "double"),
        ("time_s", "x", ".*string"),
        ("world_fill", {"a": 1}, "struct"),
    ],
)
def test_a_column_of_another_type_is_named(tmp_path, column, value, held):
    import pandas as pd

    write(tmp_path, KEYS)
    frame = pd.read_parquet(tmp_path / EPISODES)
    frame[column] = [value] * len(frame)
    frame.to_parquet(tmp_path / EPISODES)
    with pytest.raises(
        InputError, match=rf"episodes\.parquet: column '{column}' holds {held}.*: not a file of lme"
    ):
        read_episodes([tmp_path])


def test_records_that_pandas_has_written_again_are_read(tmp_path):
    """With categories, a number that is missing, and a column of the user's own."""
    import pandas as pd

    write(tmp_path, KEYS)
    frame = pd.read_parquet(tmp_path / EPISODES)
    frame["steps"] = frame["steps"].astype(float).where(frame["run"] == 0)
    frame = frame.assign(outcome=frame["outcome"].astype("category"), checked=True, note="x")
    frame.to_parquet(tmp_path / EPISODES)
    assert read_episodes([tmp_path])["outcome"].tolist() == frame["outcome"].tolist()


def test_rows_without_an_outcome_are_refused(tmp_path, says):
    import pandas as pd

    write(tmp_path, KEYS)
    pd.read_parquet(tmp_path / EPISODES).assign(outcome=None).to_parquet(tmp_path / EPISODES)
    with says.raises(InputError):
        read_episodes([tmp_path])


def test_a_trajectory_without_its_steps_is_refused(tmp_path, says):
    import pandas as pd

    write(tmp_path, KEYS)
    pd.read_parquet(tmp_path / TRAJECTORIES).drop(columns="step").to_parquet(tmp_path / TRAJECTORIES)
    with says.raises(InputError):
        read_trajectories([tmp_path])


@pytest.mark.parametrize(
    "damage",
    [
        {"record": {"system": 5}},
        {"record": {"time_s": "x"}},
        {"record": {"steps": 2**70}},
        {"record": {"world": "3"}},
        {"record": {"system": "\ud800"}},
        {"record": {"\ud800": 1}},
        {"trajectory": {"x_m": ["<f8", ""]}},
        {"trajectory": {"x_m": ["<U2", "AAAAAAAAAAA="]}},
        {"trajectory": {"x_m": ["<f8,(", "AAAAAAAAAAA="]}},  # numpy evaluates what has a comma
    ],
)
def test_a_line_with_a_value_of_another_kind_is_named(tmp_path, damage, says):
    write(tmp_path, KEYS[:1], merge=False)
    log = tmp_path / "parts" / "episodes.jsonl"
    entry = json.loads(log.read_text())
    for part, values in damage.items():
        entry[part] |= values
    log.write_text(json.dumps(entry) + "\n")
    with says.raises(InputError):
        read_episodes([tmp_path])


def test_records_that_disagree_are_reported_in_one_line(tmp_path):
    write(tmp_path, KEYS[:2], merge=False)
    log = tmp_path / "parts" / "episodes.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text(lines[0] + lines[1].replace('"world_fill": ', '"world_fill": "x", "other": '))
    with pytest.raises(InputError, match=r"records in .* disagree: .*"):
        read_episodes([tmp_path])


@pytest.mark.parametrize("nested", ["[" * 100_000, '{"a":' * 100_000])
def test_json_that_is_nested_too_deep_is_damage(tmp_path, nested, says):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "episodes.jsonl").write_text(nested + "\n")
    with says.raises(InputError):
        read_episodes([tmp_path])
    (tmp_path / LAUNCH).write_text(nested)
    with says.raises(InputError):
        read_launch(tmp_path)
