"""`lme export`: records and steps for other programs, every digit of them."""

import io
import json
import math
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

import lme
from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.cli import main
from runners.cli.commands import export
from runners.records.episode_record import EpisodeResult
from runners.records.records import RecordWriter
from tests.builders import episode_record
from tests.composing import jobs_of
from tests.made_runs import write_run

AWKWARD = [0.1 + 0.2, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0, 1e16, math.inf]


def read(text):
    return pd.read_csv(io.StringIO(text), float_precision="round_trip", keep_default_na=False, na_values=[""])


@pytest.fixture
def run(tmp_path):
    """Episodes whose numbers need all their digits; that of world 6 has no BARN metric, that of world 0 failed."""
    with RecordWriter(tmp_path / "run") as writer:
        for world, value in enumerate(AWKWARD):
            steps = np.full((2, len(TRAJECTORY_COLUMNS)), value)
            steps[1, 6:8] = np.nan
            numbers = {"path_length_m": value, "barn_metric": math.nan if world == 6 else 0.25}
            record = episode_record(world, outcome="success" if world else "timeout", **numbers)
            writer.append(EpisodeResult(record, steps))
        writer.merge()
    return tmp_path / "run"


def test_records_come_back_to_the_last_bit(run, capsys):
    assert export.main([str(run)]) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    there = pd.read_parquet(run / "episodes.parquet")
    here = read(shown.out)
    assert list(here.columns) == list(there.columns)
    assert here["path_length_m"].to_numpy().tobytes() == there["path_length_m"].to_numpy().tobytes()
    empty = {"global_map": "", "subset": "", "contact_part": ""}
    here = here.astype(dict.fromkeys(empty, object)).fillna(empty)
    pd.testing.assert_frame_equal(here, there, check_exact=True, check_dtype=False)


def test_one_row_is_counted_in_the_singular(tmp_path, capsys):
    write_run(tmp_path / "one", worlds=(200,))
    assert export.main([str(tmp_path / "one"), "-o", str(tmp_path / "one.csv")]) == 0
    assert capsys.readouterr().out == f"1 row: {tmp_path / 'one.csv'}\n"


def test_steps_come_back_to_the_last_bit(run, capsys):
    export.main([str(run), "--steps"])
    here, there = read(capsys.readouterr().out), pd.read_parquet(run / "trajectories.parquet")
    assert list(here.columns) == list(there.columns)
    for name in TRAJECTORY_COLUMNS:
        assert here[name].to_numpy(float).tobytes() == there[name].to_numpy().tobytes(), name


@pytest.mark.parametrize(
    ("words", "worlds"),
    [(["failures"], [0]), (["3/0"], [3]), (["2", "4"], [2, 4]), (["failures", "5"], [0, 5])],
)
def test_steps_of_some_episodes(run, capsys, words, worlds):
    export.main([str(run), "--columns", "world,step", "--steps", *words])
    assert capsys.readouterr().out.splitlines() == [
        "world,step",
        *(f"{world},{step}" for world in worlds for step in (0, 1)),
    ]


def test_json_lines_have_null_for_what_json_lacks(run, capsys):
    export.main([str(run), "--format", "jsonl", "--columns", "world,path_length_m,barn_metric"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[1] == {"world": 1, "path_length_m": 1 / 3, "barn_metric": 0.25}
    assert lines[6] == {"world": 6, "path_length_m": None, "barn_metric": None}


@pytest.mark.parametrize("name", ["some.csv", "some.jsonl", "some.parquet", "SOME.CSV", "some"])
def test_the_ending_of_the_file_is_its_format(run, tmp_path, capsys, name):
    path = tmp_path / name
    export.main([str(run), "--columns", "run,world", "-o", str(path)])
    assert capsys.readouterr().out == f"7 rows: {path}\n"
    content = path.read_bytes()
    start = {"jsonl": b'{"run": 0, "world": 0}\n', "parquet": b"PAR1"}.get(
        path.suffix[1:], b"run,world\n0,0\n"
    )
    assert content.startswith(start)
    if path.suffix == ".parquet":
        assert pd.read_parquet(path).to_dict("list") == {"run": [0] * 7, "world": list(range(7))}


def test_several_runs_go_into_one_file_that_tells_them_apart(tmp_path, capsys):
    with jobs_of() as job:
        for number, latency in enumerate(("0.1", "0.2")):
            write_run(tmp_path / str(number), job=job(f"sim.latency={latency}"))
    export.main([str(tmp_path)])
    rows = read(capsys.readouterr().out)
    assert rows.columns[0] == "run_dir"
    assert rows["run_dir"].tolist() == [str(tmp_path / str(number)) for number in (0, 0, 1, 1)]
    assert rows["sim.latency"].tolist() == [0.1, 0.1, 0.2, 0.2]
    assert set(rows["sim"]) == {"gazebo"}
    export.main([str(tmp_path), "--steps", "failures", "--columns", "run_dir,world"])
    steps = read(capsys.readouterr().out)
    assert steps.groupby("run_dir").size().tolist() == [20, 20]
    assert set(steps["world"]) == {201}


def test_a_changed_key_without_a_dot_is_a_column_too(tmp_path, capsys):
    with jobs_of() as job:
        for name, words in (("a", []), ("b", ["feedback=CLOSED_LOOP"])):
            write_run(tmp_path / name, job=job(*words), worlds=(200,))
    export.main([str(tmp_path / "a"), str(tmp_path / "b")])
    assert read(capsys.readouterr().out)["feedback"].tolist() == ["OPEN_LOOP", "CLOSED_LOOP"]


def test_a_run_that_lacks_a_column_has_it_empty(tmp_path, capsys):
    write_run(tmp_path / "a", world_measures={"fill": 0.5})
    write_run(tmp_path / "b")
    for style, path in (("csv", None), ("parquet", tmp_path / "all.parquet")):
        into = ["-o", str(path)] if path else []
        export.main([str(tmp_path / "a"), str(tmp_path / "b"), "--format", style, *into])
        shown = capsys.readouterr().out
        rows = pd.read_parquet(path) if path else read(shown)
        assert rows["world_fill"].isna().tolist() == [False, False, True, True]


def test_an_unfinished_run(tmp_path, capsys):
    with RecordWriter(tmp_path) as writer:
        writer.append(EpisodeResult(episode_record(200), np.zeros((3, len(TRAJECTORY_COLUMNS)))))
    export.main([str(tmp_path), "--steps"])
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_a_run_without_steps_is_driven_once_more(tmp_path, capfd, says):
    run_dir = tmp_path / "run"
    lme.evaluate("map.worlds=[200,203]", runs=2, executor="serial", progress=False, into=run_dir)
    export.main([str(run_dir), "--steps"])
    before = capfd.readouterr().out
    (run_dir / "trajectories.parquet").unlink()
    export.main([str(run_dir), "--steps"])
    assert capfd.readouterr() == (before, "")
    export.main([str(run_dir), "--steps", "203/1"])
    assert [line for line in before.splitlines() if line.startswith("203,1,")] == (
        capfd.readouterr().out.splitlines()[1:]
    )
    records = pd.read_parquet(run_dir / "episodes.parquet")
    records.assign(path_length_m=1.0).to_parquet(run_dir / "episodes.parquet")
    assert main.main(["export", str(run_dir), "--steps", "200"]) == 2
    says(capfd.readouterr().err)
    (run_dir / "launch.json").unlink()
    assert main.main(["export", str(run_dir), "--steps", "200"]) == 2
    says(capfd.readouterr().err)


@pytest.mark.parametrize(
    "words",
    [
        ["--columns", "worlt"],
        ["--format", "parquet"],
        ["--steps", "9"],
        ["--steps", "9x"],
        ["--columns", "world,run,world"],
        ["-o", "some.xlsx"],
        ["-o", "some.csv", "--format", "jsonl"],
        ["-o", "/nowhere/some.csv"],
    ],
    ids=" ".join,
)
def test_mistakes_are_one_line(run, capsys, words, says):
    assert main.main(["export", str(run), *words]) == 2
    shown = capsys.readouterr()
    says(shown.err)
    assert (shown.err.count("\n"), shown.out) == (1, "")


@pytest.mark.parametrize(
    "name", ["episodes.parquet", "trajectories.parquet", "launch.json", "parts/episodes.jsonl"]
)
def test_the_files_of_a_run_are_not_replaced(run, says, name):
    style = ["--format", "csv"] if name == "launch.json" else []
    with says.raises(InputError):
        export.main([str(run), *style, "--output", str(run / name)])
    assert len(pd.read_parquet(run / "episodes.parquet")) == len(AWKWARD)


@pytest.mark.parametrize("name", ["episodes.parquet", "parts/episodes.jsonl"])
def test_the_files_of_a_run_that_is_not_named_are_not_replaced(run, tmp_path, says, name):
    other = tmp_path / "other"
    (other / name).parent.mkdir(parents=True)
    for file in ("launch.json", name):
        (other / file).write_text("kept")
    with says.raises(InputError):
        export.main([str(run), "--output", str(other / name)])
    assert (other / name).read_text() == "kept"


def test_exporting_failures_of_a_run_without_any_is_an_error(tmp_path, capsys, says):
    write_run(tmp_path, worlds=(200,))
    assert main.main(["export", str(tmp_path), "--steps", "failures"]) == 2
    says(capsys.readouterr().err)


def test_a_reader_that_closes_the_pipe(run):
    words = [sys.executable, "-m", "runners.cli.main", "export", str(run), "--steps"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def shell(run, words):
    """What a shell's command line writes to standard output and standard error."""
    lme = f"{sys.executable} -m runners.cli.main export {run} --columns world"
    return subprocess.run(
        ["bash", "-c", words.format(lme=lme)], cwd=run.parent, capture_output=True, text=True
    )


@pytest.mark.parametrize(
    "words",
    [
        "{lme} --output /dev/stdout | cat",
        "{lme} --output /dev/stdout > some.csv; cat some.csv",
        "touch some.csv; {lme} --output /dev/stdout >> some.csv; cat some.csv",
        "{lme} --output >(cat > some.csv) > said; sleep 0.5; cat some.csv; cat said >&2",
    ],
)
def test_an_output_that_is_no_file_gets_the_rows_and_nothing_else(run, words):
    done = shell(run, words)
    assert done.stdout.splitlines() == ["world", *map(str, range(7))]
    assert done.stderr.startswith("7 rows: /dev/")


def test_a_reader_of_the_output_that_has_seen_enough(run):
    done = shell(run, "{lme} --output /dev/stdout | true; exit ${{PIPESTATUS[0]}}")
    assert (done.returncode, done.stderr) == (0, "")


def test_an_output_that_is_full_is_one_line(run, capsys, says):
    assert main.main(["export", str(run), "--output", "/dev/full"]) == 2
    says(capsys.readouterr().err)


def test_the_format_may_differ_from_an_ending_that_is_none(run, tmp_path):
    export.main([str(run), "-o", str(tmp_path / "some.txt"), "--format", "jsonl"])
    assert json.loads((tmp_path / "some.txt").read_text().splitlines()[3])["world"] == 3


@pytest.mark.parametrize(
    "words", [["--steps", "3/0", "RUN"], ["--steps", "RUN", "3"], ["RUN", "--steps", "3"]]
)
def test_a_run_may_stand_behind_the_steps(run, capsys, words):
    assert (
        main.main(["export", "--columns", "world,step", *(str(run) if w == "RUN" else w for w in words)]) == 0
    )
    assert capsys.readouterr().out.splitlines() == ["world,step", "3,0", "3,1"]


def test_steps_of_no_run(capsys, says):
    assert main.main(["export", "--steps", "3/0"]) == 2
    says(capsys.readouterr().err)
