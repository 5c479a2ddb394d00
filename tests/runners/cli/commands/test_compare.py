"""`lme compare`: any runs that share worlds, paired; what is said where the pairs are not fair."""

import csv
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.cli import main
from runners.cli.commands import compare
from runners.records.episode_record import EpisodeResult
from runners.records.launch_record import launch_of
from runners.records.records import RecordWriter, read_episodes, read_runs
from runners.reports.analysis import paired
from runners.reports.analysis.compare_report import to_markdown
from runners.reports.analysis.compare_runs import NOT_COMPARED, compare_runs
from runners.reports.analysis.shared_worlds import ComparedRun, run_names, same_worlds
from tests.builders import episode_record
from tests.composing import jobs_of, last_of_each

WORLDS = range(60)


@pytest.fixture(scope="module")
def job():
    with jobs_of("eval", "map.worlds=[0]") as job:
        yield job


def write(run_dir, job=None, rate=0.9, worlds=WORLDS, runs=(0, 1), **columns):
    """A run that succeeds in this share of the worlds, the same ones for the same rate."""
    drawn = np.random.default_rng(0).random(1000) < rate
    with RecordWriter(run_dir) as writer:
        for world in worlds:
            good = {"outcome": "success" if drawn[world] else "timeout", "barn_metric": 0.4 * drawn[world]}
            for run in runs:
                record = episode_record(world, run, **{**good, "path_length_m": 9.0 + run, **columns})
                writer.append(EpisodeResult(record, np.zeros((2, len(TRAJECTORY_COLUMNS)))))
        writer.merge()
    if job is not None:
        launch_of("eval", [job], [], False, None).write(run_dir)
    return str(run_dir)


def said(capsys, *words):
    assert compare.main([*map(str, words)]) == 0
    return " ".join(capsys.readouterr().out.split())


def lines(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_ablations_have_their_labels_and_short_ones_what_they_set(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("own/ablation").mkdir(parents=True)
    Path("own/ablation/short.yaml").write_text("# Parameters alone\nc_t: 0.5\n")
    words = ["map.worlds=[0]", "map.time_limit=0.3", "runs=1", "executor=serial", "tracking=none"]
    sweep = ["--config-dir", "own", "ablation=none,no_c_o,[no_c_o,short]", "hydra.sweep.dir=out"]
    assert main.main(["eval", "-m", *words, *sweep]) == 0
    capsys.readouterr()
    text = said(capsys, "out")
    assert "Differences from: complete" in text
    assert "without c_o (1 world" in text
    assert "without c_o and with c_t=0.5 (1 world" in text


def test_a_sweep_of_weights_is_named_by_them_and_compared_where_it_lies(tmp_path, job, capsys):
    for number, (weights, rate) in enumerate((("published", 0.5), ("skid", 0.95))):
        write(tmp_path / str(number), job(f"weights={weights}"), rate, weights=weights)
    text = said(capsys, tmp_path)
    assert "LME · barn · jackal" in text
    assert "Differences from: weights published" in text
    assert "weights skid (60 worlds, 120 pairs; BARN metric better in " in text
    assert "All have seed 0: both episodes of a pair draw from the same random numbers." in text
    assert re.search(r"To find a difference of 0\.05 in success takes about [\d,]+ worlds like these", text)
    assert text.endswith(
        f"compare.md, compare.csv, compare.tex, compare_worlds.csv, compare.png in {tmp_path}"
    )
    markdown = (tmp_path / "compare.md").read_text(encoding="utf-8")
    assert "| `guide.parameters.a_close` | 1.51 | 3.311 |" in markdown
    assert "![barn_metric by world](compare.png)" in markdown
    assert (tmp_path / "compare.png").read_bytes().startswith(b"\x89PNG")


def test_runs_that_only_lie_in_one_folder_are_not_compared(tmp_path, job):
    runs = [write(tmp_path / name, job(), 0.9) for name in ("monday", "tuesday")]
    with pytest.raises(InputError, match=r"is a folder of 2 runs, not a sweep: name the runs") as error:
        compare.main([str(tmp_path)])
    assert f"lme compare {runs[0]} {runs[1]}" in str(error.value)
    assert not (tmp_path / "compare.md").exists()


def test_the_figures_are_those_of_paired_differences(tmp_path, job, capsys):
    runs = [write(tmp_path / name, job(), rate) for name, rate in (("a", 0.5), ("b", 0.9), ("c", 0.6))]
    said(capsys, *runs, "--into", tmp_path / "into")
    a, b, c = (read_episodes([run]) for run in runs)
    expected = paired.compare(paired.Block({}, a, {"b": b, "c": c}), paired.SUCCESS)
    found = {
        row["run"]: row for row in lines(tmp_path / "into" / "compare.csv") if row["measure"] == "success"
    }
    assert list(found) == ["b", "c"]
    for name, row in found.items():
        assert float(row["difference"]) == expected[name].mean
        assert (float(row["low"]), float(row["high"])) == (expected[name].low, expected[name].high)
        assert (float(row["p"]), float(row["p_holm"])) == (expected[name].p, expected[name].adjusted)
        assert float(row["mean"]) - float(row["reference_mean"]) == pytest.approx(expected[name].mean)
    worlds = [row for row in lines(tmp_path / "into" / "compare_worlds.csv") if row["run"] == "b"]
    gained = [row["world"] for row in worlds if row["mean"] > row["reference_mean"]]
    means = a.groupby("world")["barn_metric"].mean() < b.groupby("world")["barn_metric"].mean()
    assert gained == [str(world) for world in means.index[means]]


def test_columns_that_are_not_compared_need_not_be_read(tmp_path, job):
    runs = [Path(write(tmp_path / name, job(), rate)) for name, rate in (("a", 0.5), ("b", 0.9))]
    every, few = (read_runs(runs, without) for without in ((), NOT_COMPARED))
    assert len(few[0].columns) < len(every[0].columns) - 10
    assert to_markdown(compare_runs(few)) == to_markdown(compare_runs(every))


def test_times_are_of_pairs_in_which_both_succeeded(tmp_path, job, capsys):
    one = write(tmp_path / "a", job(), 0.5, time_s=8.0)
    other = write(tmp_path / "b", job(), 0.9, time_s=10.0)
    said(capsys, one, other, "--into", tmp_path / "into")
    rows = {row["measure"]: row for row in lines(tmp_path / "into" / "compare.csv")}
    both = 2 * int((np.random.default_rng(0).random(1000)[:60] < 0.5).sum())
    assert float(rows["time_s"]["difference"]) == 2.0
    assert (int(rows["time_s"]["pairs"]), int(rows["success"]["pairs"])) == (both, 120)


def test_the_first_is_the_reference_and_a_job_can_come_before_its_sweep(tmp_path, job, capsys):
    for number, system in enumerate(("LME", "DWA")):
        write(tmp_path / "sweep" / str(number), job(), system=system)
    text = said(capsys, tmp_path / "sweep" / "1", tmp_path / "sweep", "--into", tmp_path / "into")
    assert "Differences from: DWA" in text
    assert not (tmp_path / "sweep" / "compare.md").exists()


def test_worlds_of_one_run_alone_are_left_out_and_counted(tmp_path, job, capsys):
    one = write(tmp_path / "a", job(), worlds=range(30))
    other = write(tmp_path / "b", job("seed=1"), worlds=range(20, 60), runs=(0,), seed=1)
    text = said(capsys, one, other, "--into", tmp_path / "into")
    assert (
        "seed 1: 10 shared worlds; left out: 20 worlds that only the reference drove, 30 worlds that only it drove, "
        "10 episodes that only one of the two drove in shared worlds."
    ) in text
    assert "Seeds differ (0, 1): pairs with another seed share the world, not the random numbers." in text


def test_worlds_of_one_number_that_are_not_the_same_are_left_out(tmp_path, job, capsys):
    one = write(tmp_path / "a", job(), worlds=range(20))
    with RecordWriter(tmp_path / "b") as writer:
        for world in range(20):
            place = {"goal_x_m": float(world < 5), "outcome": "timeout"}
            steps = np.zeros((2, len(TRAJECTORY_COLUMNS)))
            writer.append(EpisodeResult(episode_record(world, **place), steps))
    text = said(capsys, one, tmp_path / "b", "--into", tmp_path / "into")
    assert "15 shared worlds; left out: 5 worlds with another start, goal or layout" in text
    assert "Not every run has a launch.json" in text


def test_no_world_that_is_the_same_is_not_called_no_episode_alone(tmp_path, job):
    runs = [write(tmp_path / name, job(), worlds=(1,), goal_x_m=x) for name, x in (("a", 0.0), ("b", 1.0))]
    with pytest.raises(InputError, match=r"worlds with the same number have another start, goal or layout$"):
        compare.main(runs)


@pytest.mark.parametrize("sides", [(8, 9), (8, 8)])
def test_own_files_that_changed_between_the_runs_are_named(tmp_path, job, capsys, sides):
    hall = tmp_path / "hall.yaml"
    runs = []
    for name, side in zip("ab", sides, strict=True):
        hall.write_text(f"bounds: [0, 0, 12, {side}]\n")
        own_job = job("map=file", f"map.path={hall}", "map.start=[1,1]", "map.goal=[9,1]")
        runs.append(write(tmp_path / name, own_job, worlds=(0,), map="hall"))
    text = said(capsys, *runs, "--into", tmp_path / "into")
    assert ("Not the same in all of these runs: hall.yaml." in text) == (sides == (8, 9))


def same(one, other):
    """The worlds that two runs share, numbered from 0, given a measure of each world."""
    runs = [
        ComparedRun(
            Path("run"),
            pd.DataFrame({"world": range(len(values)), "map": "barn", "run": 0, "world_measure": values}),
        )
        for values in (one, other)
    ]
    return same_worlds(*runs)


def test_measures_that_are_texts_tell_worlds_apart():
    assert same(["disc", "disc", None], ["disc", "rectangle", None]) == {0, 2}
    assert same(["disc", None], [None, "disc"]) == set()


def test_measures_that_are_numbers_tell_worlds_apart_but_for_rounding():
    nan = float("nan")
    assert same([1.0, 1.0, nan, nan], [1.0 + 1e-9, 1.1, nan, 1.0]) == {0, 2}
    assert same([1.0, 1.0], ["disc", 1.0]) == {1}


def test_runs_of_the_cold_trial_are_compared(tmp_path, job, capsys):
    """Some measures of its worlds are texts."""
    measures = {"family": "rooms", "footprint": "disc", "v_max": 1.5}
    runs = [
        write(tmp_path / system, job(), system=system, worlds=(1, 2), world_measures=measures)
        for system in ("LME", "DWA")
    ]
    assert "DWA (2 worlds, 4 pairs" in said(capsys, *runs, "--into", tmp_path / "into")


def test_worlds_with_people_are_not_those_without(tmp_path, job, capsys):
    """Only one of the runs has the number of people."""
    empty = write(tmp_path / "empty", job(), worlds=(1, 2))
    crowd = [
        write(
            tmp_path / system, job("crowd=orca"), system=system, worlds=(1, 2), world_measures={"people": 3.0}
        )
        for system in ("LME", "DWA")
    ]
    text = said(capsys, *crowd, empty, "--into", tmp_path / "into")
    assert "DWA (2 worlds, 4 pairs" in text
    assert "empty shares no episode with another run" in text
    assert main.main(["compare", empty, crowd[0]]) == 2
    assert "LME drove barn with crowd orca, 2 worlds from 1 to 2" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "columns", "note"),
    [
        (
            ["robot=turtlebot2"],
            {"robot": "turtlebot2"},
            "Driven under different conditions: robot: jackal | turtlebot2.",
        ),
        (["sim=physics"], {}, "Driven under different conditions: sim: fast | physics."),
        (["sim.latency=0.1"], {}, "Driven under different conditions: sim.latency: 0 | 0.1."),
        (["cap.v_max=0.5"], {}, "Driven under different conditions: cap.v_max: null | 0.5."),
        (
            ["feedback=CLOSED_LOOP"],
            {},
            "Driven under different conditions: feedback: OPEN_LOOP | CLOSED_LOOP.",
        ),
        (["map.time_limit=60"], {}, "Driven under different conditions: map.time_limit: 100 | 60."),
        (["filter=stopping"], {}, "Driven under different conditions: filter: none | stopping."),
        (["crowd=orca"], {}, "Driven under different conditions: crowd: none | orca."),
        (["people=none"], {"people": "none"}, "Driven under different conditions: people: truth | none."),
        (["map.worlds=[7]"], {}, ""),
        (["runs=9"], {}, "Not finished:"),
    ],
)
def test_compare_says_which_conditions_differ(tmp_path, job, capsys, words, columns, note):
    usual = ["map.worlds=[1,2]", "runs=2", "sim=fast"]
    one = write(tmp_path / "a", job(*usual), worlds=(1, 2))
    other = write(tmp_path / "b", job(*last_of_each(*usual, *words)), worlds=(1, 2), **columns)
    text = said(capsys, one, other, "--into", tmp_path / "into")
    assert note in text
    assert ("Driven under different" in text) == note.startswith("Driven under different")


def test_the_filter_the_crowd_and_whom_a_system_sees_are_named(tmp_path, job, capsys):
    words = ("crowd=orca", "people=none")
    runs = [
        write(tmp_path / name, job(*words, *more), worlds=(1, 2), people="none")
        for name, more in (("a", []), ("b", ["filter=stopping"]))
    ]
    text = said(capsys, *runs, "--into", tmp_path / "into")
    assert (
        "LME · people none · barn · jackal · sim gazebo · crowd orca Differences from: no filter Measure"
        in text
    )
    assert "filter stopping (2 worlds" in text
    runs = [write(tmp_path / name, None, worlds=(1, 2), people=name) for name in ("truth", "none")]
    assert "people none (2 worlds" in said(capsys, *runs, "--into", tmp_path / "into")


def test_a_filter_is_unknown_without_a_launch_record(tmp_path, job, capsys):
    runs = [
        write(tmp_path / "a", None, worlds=(1, 2)),
        write(tmp_path / "b", job("filter=stopping"), worlds=(1, 2)),
    ]
    assert "filter: unknown | stopping" in said(capsys, *runs, "--into", tmp_path / "into")


def test_runs_of_several_maps_are_compared_map_by_map(tmp_path, job, capsys):
    runs = [
        write(tmp_path / f"{place}-{system}", job(), system=system, map=place)
        for place in ("barn", "env1")
        for system in ("LME", "DWA")
    ]
    alone = write(tmp_path / "alone", job(), map="env2", worlds=(3,))
    text = said(capsys, *runs, alone, "--into", tmp_path / "into")
    assert text.count("Differences from: LME") == 2
    assert "shares no episode with another run; it drove env2, world 3, runs 0 to 1." in text
    assert {"compare_1.png", "compare_2.png"} <= {path.name for path in (tmp_path / "into").iterdir()}


def test_a_run_without_a_pair_is_left_out_and_said(tmp_path, job, capsys):
    """It drove the same worlds, but no run of the same number."""
    runs = [
        write(tmp_path / system, job(f"seed={seed}"), rate, system=system, runs=numbers, seed=seed)
        for seed, (system, numbers, rate) in enumerate((("A", (0,), 0.9), ("B", (1,), 0.2), ("C", (0,), 0.5)))
    ]
    text = said(capsys, *runs, "--into", tmp_path / "into")
    assert "B shares no episode with another run; it drove barn, 60 worlds from 0 to 59, run 1." in text
    lines_of_keys = (tmp_path / "into" / "compare.md").read_text(encoding="utf-8").splitlines()
    assert "| Key | A, seed 0 | C, seed 2 |" in lines_of_keys
    assert "| `seed` | 0 | 2 |" in lines_of_keys
    assert main.main(["compare", runs[0], runs[1]]) == 2
    assert "A drove barn, 60 worlds from 0 to 59, run 0; " in capsys.readouterr().err


def test_names_say_nothing_of_which_worlds_and_no_usual_weights(tmp_path, job, capsys):
    runs = [write(tmp_path / str(n), job(f"map.count={n}", f"robot.v_max={n}")) for n in (1, 3)]
    assert "Differences from: robot.v_max 1 Measure" in said(capsys, *runs, "--into", tmp_path / "into")
    pairs = {"LME": "lme", "LME+": "lme_plus"}
    runs = [
        write(tmp_path / label, job(f"system={name}"), system=label, guide=name, weights="published")
        for label, name in pairs.items()
    ]
    assert "LME+ (60 worlds" in said(capsys, *runs, "--into", tmp_path / "into")


def test_names_do_not_repeat_a_value():
    keys = {"robot.v_max": [1, 2], "robot.omega_max": [1, 2], "planner.v_max": [1, 2]}
    runs = [
        ComparedRun(Path(f"run{at}"), pd.DataFrame({key: [values[at]] for key, values in keys.items()}))
        for at in range(2)
    ]
    assert run_names(runs) == ["robot.v_max 1, robot.omega_max 1", "robot.v_max 2, robot.omega_max 2"]


def test_equal_runs_are_named_by_their_folders(tmp_path, job, capsys):
    text = said(
        capsys, write(tmp_path / "a", job()), write(tmp_path / "b", job()), "--into", tmp_path / "into"
    )
    assert "Differences from: a " in text
    assert re.search(r"Success 0\.\d+ 0\.\d+ 0\.000 0\.000 to 0\.000 1\.000", text)


def test_many_runs_show_two_measures_on_the_terminal_and_all_in_the_file(tmp_path, job, capsys):
    runs = [write(tmp_path / str(n), job(), 0.5 + 0.05 * n, system=f"S{n}") for n in range(7)]
    text = said(capsys, *runs, "--into", tmp_path / "into")
    assert text.count("BARN metric better in") == 6
    assert "Path [m]" not in text
    assert "The other measures are in compare.md." in text
    assert "Path [m]" in (tmp_path / "into" / "compare.md").read_text(encoding="utf-8")


def test_latex_has_a_caption_and_what_a_reader_must_know(tmp_path, job, capsys):
    runs = [
        write(tmp_path / name, job(f"seed={seed}"), rate, seed=seed)
        for name, seed, rate in (("a", 0, 0.9), ("b", 1, 0.2))
    ]
    compare.main([*runs, "--format", "tex", "--into", str(tmp_path / "into")])
    text = capsys.readouterr().out
    assert text == (tmp_path / "into" / "compare.tex").read_text(encoding="utf-8")
    (caption,) = re.findall(r"\\caption\{(.*)\}", text)
    assert (
        r"Differences from seed 0: LME · barn · jackal · sim gazebo · 60 worlds $\times$ 2 runs, seeds 0, 1; lme "
        in caption
    )
    assert r"\item Seeds differ (0, 1)" in text
    assert r"seed 1 & Success & 0." in text
    assert r" & BARN metric & 0." in text


def test_markdown_on_standard_output_is_alone_there(tmp_path, job, capsys):
    one, other = write(tmp_path / "a", job()), write(tmp_path / "b", job(), 0.5)
    compare.main([one, other, "--format", "md", "--into", str(tmp_path / "into")])
    shown = capsys.readouterr()
    assert shown.out.startswith("**LME · barn · jackal · sim gazebo**\n\nReference: a")
    assert shown.err.startswith("Tables and pictures: ")


def test_without_into_compare_writes_below_outputs(tmp_path, job, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a", job())
    write(tmp_path / "b", job(), 0.5)
    text = said(capsys, "a", "b")
    (place,) = (tmp_path / "outputs" / "compare").iterdir()
    assert text.endswith(f"in outputs/compare/{place.name}")


def test_mistakes_are_one_line(tmp_path, job, capsys):
    one = write(tmp_path / "a", job(), worlds=(1, 2))
    other = write(tmp_path / "b", job(), worlds=(3,))
    (tmp_path / "file").touch()
    for words, problem in (
        ([one], "a: is a single run; give two or more runs, or a sweep"),
        ([one, one], "a: is a single run"),
        (
            [one, other],
            "no two of these runs share an episode: .*a drove barn, 2 worlds from 1 to 2, runs 0 to 1; .*b drove",
        ),
        ([one, tmp_path / "nowhere"], "nowhere is not a directory"),
    ):
        assert main.main(["compare", *map(str, words)]) == 2
        assert re.fullmatch(rf"lme compare: .*{problem}.*\n", capsys.readouterr().err)
    third = write(tmp_path / "c", job(), worlds=(1, 2))
    assert main.main(["compare", one, third, "--into", str(tmp_path / "file" / "below")]) == 2
    assert "what is printed above is all" in capsys.readouterr().err
