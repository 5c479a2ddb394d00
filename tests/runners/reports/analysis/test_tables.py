"""Tables against figures counted by hand."""

import csv
import io
import re

import numpy as np
import pandas as pd
import pytest
import yaml

from lme.inputs.resources import resource_dir
from lme.metrics import wilson_interval
from runners.config.systems import System, systems
from runners.reports.analysis import tables
from runners.reports.analysis.summary import DASH, metrics, metrics_by_map, summarise
from runners.reports.analysis.tables import notes, title, to_csv, to_html, to_latex, to_markdown

FIGURES = {
    "barn": {
        "robots": ["jackal", "jackal_real"],
        "success": [0.883, 0.0094],
        "barn_metric": [0.419, 0.0084],
    },
    "env1": {"robots": ["stage"], "success": [0.95, 0.01]},
}
SYSTEMS = {
    "lme": System("LME", "lme", "simple", published=FIGURES),
    "other": System("Other", "target", "simple"),
}


def records(outcomes=("success",) * 9 + ("collision",), runs=2, **columns):
    """`outcomes` in worlds 200…; in every run after the first, world 200 times out."""
    rows = []
    for run in range(runs):
        for index, outcome in enumerate(outcomes):
            outcome = "timeout" if run and not index else outcome
            success = outcome == "success"
            rows.append(
                {
                    "system": "LME",
                    "ablation": "none",
                    "weights": "published",
                    "robot": "jackal",
                    "map": "barn",
                    "subset": "lab100",
                    "seed": 0,
                    "world": 200 + index,
                    "run": run,
                    "outcome": outcome,
                    "time_s": 10.0 + index if success else 99.0,
                    "barn_metric": 0.5 if success else 0.0,
                    "path_length_m": 11.0 if success else 55.0,
                    "spl": 0.8 if success else 0.0,
                    "mean_abs_domega_radps": 0.125 if success else 0.25,
                    "world_visibility": index / 10,
                    "run_dir": "one",
                    **columns,
                }
            )
    return pd.DataFrame(rows)


def test_figures_by_hand():
    """Ten worlds, two runs: 9 + 8 successes, a collision in each, a time-out in the second."""
    ours = summarise(records(), systems=SYSTEMS)[0]
    assert (ours.label, ours.episodes, ours.worlds, ours.runs) == ("LME", 20, 10, 2)
    expected = {
        "success": (0.85, 0.05),
        "collision": (0.1, 0.0),
        "timeout": (0.05, 0.05),
        "barn_metric": (0.425, 0.025),
        "time_s": (14.25, 0.25),  # successes only: mean of 10…18, and of 11…18
        "path_length_m": (11.0, 0.0),
        "spl": (0.68, 0.04),
        "mean_abs_domega_radps": (0.14375, 0.00625),
    }
    assert ours.stats == {name: pytest.approx(values) for name, values in expected.items()}
    # By world 1, 2 × 8 and 0 of 2: as 0.85 · 0.15 / ((0.7² + 8 · 0.3² + 1.7²) / 20²) = 12.4 independent episodes.
    assert ours.interval == pytest.approx(wilson_interval(0.85 * 12.439, 12.439), abs=5e-5)


def test_one_run_has_no_deviation():
    row = summarise(records(runs=1), systems=SYSTEMS)[0]
    assert np.isnan(row.stats["success"][1])
    assert "±" not in "".join(notes([row]))
    assert metrics(records(runs=1))["success"] == 0.9
    assert "success_std" not in metrics(records(runs=1))


def test_metrics_of_several_maps_are_their_means_and_each_maps_own():
    hall = records(("success",) * 5, runs=1, map="hall", run_dir="two")
    values = metrics_by_map(pd.concat([records(runs=1), hall]))
    assert (values["success"], values["barn/success"], values["hall/success"]) == (0.95, 0.9, 1.0)
    assert (values["episodes"], values["hall/episodes"]) == (15.0, 5.0)
    assert "success_low" not in values  # an interval has no mean
    assert metrics_by_map(hall) == metrics(hall)


@pytest.mark.parametrize(
    ("columns", "published"),
    [
        ({}, True),
        ({"map": "env1", "subset": "", "robot": "stage"}, True),
        ({"map": "env1", "subset": "custom", "robot": "stage"}, False),
        ({"robot": "jackal_real"}, True),
        ({"robot": "go2"}, False),
        ({"subset": "official50"}, False),
        ({"subset": "hard100"}, False),
        ({"planned_worlds": 11, "planned_episodes": 22}, False),
        ({"planned_worlds": 10, "planned_episodes": 30}, True),
        ({"ablation": "no_c_o"}, False),
        ({"filter": "stopping"}, False),
        ({"crowd": "orca"}, False),
        ({"people": "none"}, False),
        ({"people": "truth"}, True),
        ({"weights": "mine"}, True),
        ({"map": "elsewhere"}, False),
        ({"system": "Other"}, False),
        ({"system": "target+simple"}, False),
    ],
)
def test_published_figures_are_next_to_what_they_compare_with(columns, published):
    rows = summarise(records(**columns), systems=SYSTEMS)
    assert [row.published_map is not None for row in rows] == [False, True][: 1 + published]
    text = "\n".join(notes(rows))
    assert ("2D simulator" in text) == published
    assert ("does not list its hundred worlds" in text) == (published and "map" not in columns)


FAST = "robot.v_max is 1, and 0.5 in the shipped stage"
ENV1 = {
    "map": "env1",
    "subset": "",
    "robot": "stage",
    "map_like": "env1",
    "robot_like": "stage",
    "robot_difference": "",
}


@pytest.mark.parametrize(
    ("columns", "published", "why"),
    [
        ({}, True, ""),
        ({"robot": "mine"}, True, ""),  # the paper's values under another name
        ({"robot_difference": "robot.v_max is 0.4, and 0.5 in the shipped stage"}, True, ""),  # slower
        ({"robot_like": "", "robot_difference": FAST}, False, FAST),
        ({"robot_like": "go2"}, False, "the robot stage is not the shipped one"),
        ({"robot": "mine", "robot_like": ""}, False, ""),
        ({"map_like": ""}, False, ""),
        ({"guide": "mine", "planner": "simple"}, False, ""),
    ],
)
def test_published_figures_need_the_papers_robot_and_map_by_value(columns, published, why):
    rows = summarise(records(**{**ENV1, **columns}), systems=SYSTEMS)
    assert [row.published_map is not None for row in rows] == [False, True][: 1 + published]
    lines = [line for line in notes(rows) if "left out" in line]
    assert lines == ([f"LME: published figures are left out, because {why}."] if why else [])


def test_a_system_of_ones_own_with_a_shipped_label_has_its_own_figures():
    mine = {"a_mine": System("LME", "mine", "simple"), **SYSTEMS}
    own = summarise(records(guide="mine", planner="simple"), systems=mine)
    assert [row.label for row in own] == ["LME"]
    shipped = summarise(records(guide="lme", planner="simple"), systems={**SYSTEMS, "mine": mine["a_mine"]})
    assert [row.label for row in shipped] == ["LME", "LME (published)"]


@pytest.mark.parametrize(
    ("sim", "named"), [("fast", "2D simulator"), ("physics", "rigid bodies"), ("skid", "skidding")]
)
def test_the_note_names_the_simulator(sim, named):
    said = "\n".join(notes(summarise(records(sim=sim), systems=SYSTEMS)))
    assert re.search(rf"from Gazebo; all others from this project's .*{named}.* \(sim={sim}\)\.", said)


def test_figures_of_a_log_say_where_they_are_from():
    figures = {
        "barn": {"robots": ["jackal"], "success": [0.7]},
        "barn_official50": {
            "robots": ["jackal"],
            "success": [0.98],
            "source": "a log",
            "formula": "OT/clip(AT, 4·OT, 8·OT)",
        },
    }
    systems = {"lme": System("LME", "lme", "simple", published=figures)}
    logged = summarise(records(subset="official50"), systems=systems)
    assert logged[1].stats == {"success": (0.98, pytest.approx(np.nan, nan_ok=True))}
    said = "LME (published): a log; BARN metric: OT/clip(AT, 4·OT, 8·OT)."
    assert said in notes(logged)
    assert "from Gazebo" in "".join(notes(logged))
    assert "does not list its hundred worlds" not in "".join(notes(logged))
    papers = summarise(records(), systems=systems)
    assert papers[1].stats["success"][0] == 0.7
    assert said not in notes(papers)


def test_the_projects_own_published_figures():
    rows = summarise(records())
    assert [row.label for row in rows] == ["LME", "LME (published)"]
    assert rows[1].stats["success"] == (0.883, 0.0094)
    assert rows[1].stats["barn_metric"] == (0.419, 0.0084)


def test_a_varied_key_becomes_a_column():
    ablations = ("none", "no_c_o", "no_c_t")
    frames = [
        records(ablation=name, run_dir=name, subset=subset)
        for name in ablations
        for subset in ("lab100", "official50")
    ]
    rows = summarise(pd.concat(frames), systems=SYSTEMS)
    assert {tuple(row.keys) for row in rows} == {("ablation", "subset")}
    assert [tuple(row.keys.values()) for row in rows if row.published_map is None] == [
        (name, subset) for name in ablations for subset in ("lab100", "official50")
    ]
    assert [row.keys for row in rows if row.published_map] == [{"ablation": "", "subset": "lab100"}]


def test_a_swept_key_that_no_record_holds_is_a_column():
    frames = [
        records(run_dir=value, changes=changes, **{"sim.latency": value})
        for value, changes in (("0.0", ""), ("0.1", "sim.latency=0.1"))
    ]
    rows = summarise(pd.concat(frames), systems=SYSTEMS)
    assert [row.label for row in rows] == ["LME", "LME (published)", "LME"]
    assert [row.keys for row in rows] == [{"sim.latency": "0.0"}, {"sim.latency": ""}, {"sim.latency": "0.1"}]
    assert not any(row.changes for row in rows)  # the column says it


def test_the_published_row_follows_the_run_without_filter_and_crowd():
    others = [records(filter="stopping", run_dir="two"), records(crowd="orca", run_dir="three")]
    rows = summarise(pd.concat([records(), *others]), systems=SYSTEMS)
    assert [(row.label, *row.keys.values()) for row in rows] == [
        ("LME", "", ""),
        ("LME (published)", "", ""),
        ("LME", "stopping", ""),
        ("LME", "", "orca"),
    ]


def test_a_key_changed_in_all_runs_is_named_and_hides_the_published_rows():
    frame = records(
        changes="robot.v_max=1.0, sim.latency=0.1", **{"robot.v_max": "1.0", "sim.latency": "0.1"}
    )
    rows = summarise(frame, systems=SYSTEMS)
    assert [(row.label, row.keys) for row in rows] == [("LME", {})]
    assert "robot.v_max=1.0 · sim.latency=0.1" in title(frame)
    for text in (to_markdown(rows), to_latex(frame, rows), to_html(rows)):
        assert "Changed: robot.v_max=1.0, sim.latency=0.1." in text.replace(r"\_", "_")
    assert r"\item Changed: robot.v\_max=1.0, sim.latency=0.1." in to_latex(frame, rows).splitlines()
    assert (
        next(csv.DictReader(io.StringIO(tables.to_csv(rows))))["changes"]
        == "robot.v_max=1.0, sim.latency=0.1"
    )


def test_a_key_changed_in_some_rows_is_named_with_them_and_not_in_the_title():
    frames = [
        records(run_dir="one", changes="", **{"planner.kp": "4.0"}),
        records(run_dir="two", system="Other", changes="planner.kp=8.0", **{"planner.kp": "8.0"}),
    ]
    frame = pd.concat(frames)
    assert "Changed in Other: planner.kp=8.0." in notes(summarise(frame, systems=SYSTEMS))
    assert "planner.kp" not in title(frame)


def test_every_key_that_differs_between_two_runs_is_a_column():
    frames = [
        records(run_dir="one", sim="fast", changes="", **{"robot.v_max": "2.0"}),
        records(
            run_dir="two", sim="physics", robot="go2", map="env1", subset="", changes="robot.v_max=1.0",
            **{"robot.v_max": "1.0"},
        ),
    ]  # fmt: skip
    rows = summarise(pd.concat(frames), systems={})
    assert list(rows[0].keys) == ["sim", "robot", "map", "subset", "robot.v_max"]
    assert title(pd.concat([frames[0], frames[1].iloc[:4]])).endswith("4–10 worlds × 1–2 runs")


def test_robot_and_map_are_columns_where_systems_differ_in_them():
    frames = [records(), records(run_dir="two", system="Other", robot="go2", map="env1", subset="")]
    rows = summarise(pd.concat(frames), systems={})
    assert [tuple(row.keys.values()) for row in rows] == [("jackal", "barn", "lab100"), ("go2", "env1", "")]


def test_two_runs_of_one_config_are_not_added_up():
    rows = summarise(pd.concat([records(), records(run_dir="two")]), systems=SYSTEMS)
    assert [(row.keys, row.episodes) for row in rows[:2]] == [
        ({"run_dir": "one"}, 20),
        ({"run_dir": "two"}, 20),
    ]


def test_whom_the_system_sees_is_a_column_unless_it_is_everybody():
    """Nobody is unusual here, though `none` is the usual value of other columns."""
    seen = {people: records(people=people, run_dir=people) for people in ("truth", "none")}
    assert [row.keys for row in summarise(seen["truth"], systems={})] == [{}]
    assert [row.keys for row in summarise(seen["none"], systems={})] == [{"people": "none"}]
    both = pd.concat([*seen.values(), *(part.assign(system="Other") for part in seen.values())])
    rows = summarise(both, systems={})
    assert [(row.label, row.keys) for row in rows] == [
        (f"{system}", {"people": people}) for system in ("LME", "Other") for people in seen
    ]
    assert "| System | People |" in to_markdown(rows)


def test_an_ablation_alone_is_still_named():
    rows = summarise(records(ablation="no_c_o"), systems=SYSTEMS)
    assert rows[0].keys == {"ablation": "no_c_o"}


@pytest.mark.parametrize(
    ("kept", "planned", "name"),
    [
        (20, {}, "LME"),
        (20, {"planned_worlds": 10, "planned_episodes": 20}, "LME"),
        (19, {}, "LME, 19 of 20 episodes"),
        (20, {"planned_worlds": 10, "planned_episodes": 30}, "LME, 20 of 30 episodes"),
        (4, {"planned_worlds": 10, "planned_episodes": 20}, "LME, 4 of 10 worlds"),
    ],
)
def test_a_row_says_how_much_of_an_unfinished_run_was_driven(kept, planned, name):
    frame = records(**planned).iloc[:kept]
    rows = summarise(frame, systems={})
    assert [row.name for row in rows] == [name]
    assert any("is not finished" in note for note in notes(rows)) == ("of" in name)
    for text in (to_markdown(rows), tables.to_csv(rows), to_latex(frame, rows), to_html(rows)):
        assert name in text


def test_the_rate_of_an_unfinished_run_lies_in_its_interval():
    """A hundred successes and, in a second run, one failure."""
    whole = records(("success",) * 100, runs=1)
    second = records(("collision",), runs=1).assign(run=1)
    row = summarise(pd.concat([whole, second]), systems={})[0]
    assert row.stats["success"] == (pytest.approx(100 / 101), 0.5)
    assert row.interval[0] < row.stats["success"][0] < row.interval[1]


def test_runs_of_different_worlds_in_one_row_were_to_drive_all_of_them():
    one = records(runs=1, planned_worlds=10, planned_episodes=10)
    two = one.assign(world=one["world"] + 50, run_dir="two")
    assert [row.unfinished for row in summarise(pd.concat([one, two]), systems={})] == [""]
    assert summarise(pd.concat([one, two.iloc[:3]]), systems={})[0].unfinished == "13 of 20 worlds"


def test_order_of_records_does_not_matter():
    frame = records()
    shuffled = frame.sample(frac=1.0, random_state=1)
    assert tables.to_csv(summarise(frame, systems=SYSTEMS)) == tables.to_csv(
        summarise(shuffled, systems=SYSTEMS)
    )


def test_markdown():
    text = tables.to_markdown(summarise(records(), systems=SYSTEMS))
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in text.splitlines()[:4]]
    lines = [[cell.strip() for cell in line] for line in cells]
    table = dict(zip(lines[0], zip(*lines[2:], strict=True), strict=True))
    assert table["System"] == ("LME", "LME (published)")
    assert table["Success"] == ("0.850 ± 0.050", "0.883 ± 0.009")
    assert table["95 % CI"] == (f"0.575{DASH}0.960", DASH)
    assert table["Time [s]"] == ("14.2", DASH)
    assert table[r"\|Δω\| [rad/s]"] == ("0.144", DASH)
    assert table["n"] == ("20", DASH)
    assert len({len(line) for line in lines}) == 1


def test_csv_holds_unrounded_numbers():
    rows = list(csv.DictReader(io.StringIO(tables.to_csv(summarise(records(), systems=SYSTEMS)))))
    assert float(rows[0]["success"]) == pytest.approx(0.85)
    assert float(rows[0]["success_low"]) == pytest.approx(0.5753, abs=5e-5)
    assert (rows[1]["label"], rows[1]["success_std"], rows[1]["spl"]) == ("LME (published)", "0.0094", "")


def test_records_from_before_a_column_have_tables_without_it():
    before = records(runs=1).drop(columns="mean_abs_domega_radps")
    row = summarise(before, systems=SYSTEMS)[0]
    assert "Δω" not in tables.to_markdown([row])
    both = pd.concat([before, records(system="Other", run_dir="two")])
    lines = tables.to_markdown(summarise(both, systems={})).splitlines()
    assert [line.split(" | ")[-3] for line in lines[2:4]] == [DASH, "0.144"]


def test_latex_escapes_what_latex_would_read():
    frame = records(ablation="no_c_o")
    text = tables.to_latex(frame, summarise(frame, systems=SYSTEMS))
    assert r"no\_c\_o" in text
    assert r"0.850 $\pm$ 0.050" in text
    assert r"$|\Delta\omega|$ [rad/s]" in text
    assert "95 \\% CI" in text
    assert text.count(" & ") == 2 * (len(text.split(r"\toprule")[1].splitlines()[1].split("&")) - 1)


def test_html_is_the_same_table_with_nothing_left_to_read_as_markup():
    rows = summarise(records(weights="<b>&"), systems=SYSTEMS)
    text = tables.to_html(rows)
    assert "<td>0.850 ± 0.050</td>" in text
    assert "<td>&lt;b&gt;&amp;</td>" in text
    cells = [line.count("<td>") + line.count("<th>") for line in text.splitlines() if line.startswith("<tr>")]
    assert len(cells) == 1 + len(rows)
    assert len(set(cells)) == 1


@pytest.mark.parametrize("width", [80, 100, 160])
@pytest.mark.parametrize("ablations", [["none"], ["none", "no_c_o"]])
def test_terminals_of_any_usual_width_show_every_cell_whole(width, ablations):
    frame = pd.concat([records(ablation=ablation, run_dir=ablation) for ablation in ablations])
    text = shown(frame, width, SYSTEMS)
    assert "…" not in text
    words = {"LME", "(published)", "±0.050", "0.419", "Time", "[s]", "metric", "Collision", "|Δω|"}
    assert words | {*ablations[1:]} <= set(text.split())
    assert {"n", "20", "SPL"} <= set(re.findall(r"\w+", text))
    assert "barn · lab100 · jackal · 10 worlds" in text
    assert max(map(len, text.splitlines())) <= width
    assert ("every row with a value" in text) == (width == 80 and len(ablations) > 1)


def shown(frame, width, systems):
    """What a terminal of this width shows."""
    from rich.console import Console

    console = Console(width=width, record=True, file=io.StringIO())
    console.print(tables.to_rich(summarise(frame, systems=systems), title(frame), width))
    return console.export_text()


def on_a_terminal(frame, width):
    """The lines of the table as a terminal of this width shows them: its columns, and the notes in one line."""
    text = shown(frame, width, {})
    above, _, below = text.partition("─\n")
    assert max(map(len, text.splitlines())) <= width
    return set(above.replace("─", "").split()), " ".join(below.split())


def swept(**columns):
    """Two systems at two latencies: too wide for 80 columns. columns: more that they all share."""
    return pd.concat(
        records(system=system, run_dir=f"{system}{latency}", **{"sim.latency": latency}, **columns)
        for system in ("LME", "Other")
        for latency in ("0", "0.1")
    )


def test_columns_that_are_the_same_in_all_rows_are_left_out_first():
    columns, below = on_a_terminal(swept(sim="skid"), 80)
    assert {"SPL", "Path", "Time", "sim.latency", "Success", "CI"} <= columns
    assert not {"Sim", "n", "Global"} & columns
    assert "The same in every row with a value: Global planner no, n 20, Sim skid" in below
    assert "Left out" not in below
    columns, below = on_a_terminal(swept(sim="skid"), 140)
    assert {"Sim", "n", "Global", "SPL", "Path"} <= columns
    assert "every row" not in below


def test_columns_that_do_not_fit_are_named_and_not_explained():
    frame = swept()
    later = frame["sim.latency"] == "0.1"
    for metric in ("time_s", "path_length_m", "spl", "barn_metric", "mean_abs_domega_radps"):
        frame.loc[later, metric] *= 0.5
    columns, below = on_a_terminal(frame, 52)
    assert {"sim.latency", "Success", "BARN", "Time"} <= columns
    assert not {"SPL", "Path", "|Δω|"} & columns
    assert "Left out at 52 columns: SPL, Path [m], |Δω| [rad/s]. A wider terminal shows them" in below
    assert "`lme table RUN --format md`" in below
    assert "Time is the mean over successful episodes." in below
    assert "Path" not in below.partition("Left out")[0]
    assert "|Δω|: mean change" not in below


def test_a_table_that_fits_nowhere_keeps_what_tells_rows_apart():
    columns, below = on_a_terminal(swept(), 32)
    assert {"System", "sim.latency", "Success"} <= columns
    assert "BARN metric" in below
    assert "95 % CI: Wilson" not in below


def test_the_files_of_a_table_are_written(tmp_path):
    paths = tables.write_tables(records(), summarise(records()), tmp_path)
    assert [path.name for path in paths] == ["table.md", "table.csv", "table.tex"]
    assert paths[0].read_text(encoding="utf-8").startswith("**barn · lab100 · jackal · 10 worlds")
    assert all(path.read_text(encoding="utf-8") for path in paths)


# Several systems


def test_rows_stand_in_the_order_asked_for_and_systems_not_driven_show_what_was_published():
    systems = {
        **SYSTEMS,
        "mapper": System(
            "Mapper",
            "global_path",
            None,
            global_planner=True,
            published={
                "barn": {"robots": ["jackal", "jackal_real"], "success": [0.653], "barn_metric": [0.288]}
            },
        ),
    }
    frame = pd.concat([records(), records(system="Other", global_map="known", run_dir="two")])
    rows = summarise(frame, ["other", "mapper", "lme"], systems)
    assert [row.label for row in rows] == [
        "Other", "Mapper (published)", "LME", "LME (published)",
    ]  # fmt: skip
    assert [row.global_planner for row in rows] == ["yes, true map", "yes", "no", "no"]
    assert rows[1].stats["success"][0] == 0.653
    assert np.isnan(rows[1].stats["success"][1])
    assert "| Mapper (published) | 0.653 | – |" in tables.to_markdown(rows)


def test_published_figures_of_systems_not_driven_need_the_same_worlds():
    rows = summarise(records(subset="official50"), ["lme"], SYSTEMS)
    assert [row.label for row in rows] == ["LME"]


def test_the_last_column_says_who_used_a_global_planner_once_systems_are_compared():
    frame = pd.concat([records(), records(system="Other", global_map="observed", run_dir="two")])
    header, _, *lines = tables.to_markdown(summarise(frame, systems=SYSTEMS)).splitlines()
    assert header.endswith("| n | Global planner |")
    assert [line.rpartition("| ")[2] for line in lines[:3]] == ["no |", "no |", "yes |"]
    assert "Global planner" not in tables.to_markdown(summarise(records(), systems=SYSTEMS))


@pytest.mark.parametrize(("name", "more"), [("table2", []), ("table2_ideal", ["LME as printed"])])
def test_paper_table_2_is_whole(name, more):
    """Every row of the paper, in its order, then the other reading; all of them are driven."""
    experiment = yaml.safe_load((resource_dir("conf") / "experiment" / f"{name}.yaml").read_text())
    known = systems()
    assert [known[name].name for name in experiment["table"]] == [
        "DWA", "DRL-DCLP", "S3-FISVFH", "E-Band", "KUL+FM", "DRL-VO", "DRL-DCLP", "LME-DWA", "LME-DRL", "LME", *more,
    ]  # fmt: skip
    assert experiment["hydra"]["sweeper"]["params"]["system"] == "${sweep:${table}}"
    shares = [known[name].published["barn"] for name in experiment["table"] if name != "lme_printed"]
    for each in shares:  # rounded to three digits in the paper
        assert sum(each[key][0] for key in ("success", "collision", "timeout")) == pytest.approx(1, abs=0.002)


# The BARN metric belongs to BARN


def test_beside_barn_another_map_has_a_dash():
    frame = pd.concat([records(), records(map="hall", subset="")], ignore_index=True)
    header, _, barn, hall = to_markdown(summarise(frame, systems={})).splitlines()[:4]
    column = [cell.strip() for cell in header.split("|")].index("BARN metric")
    assert barn.split("|")[column].strip() not in ("", DASH)
    assert hall.split("|")[column].strip() == DASH


@pytest.mark.parametrize(
    ("columns", "shown"),
    [
        ({"map": "dynabarn", "subset": ""}, True),
        ({"map": "my_barn", "world_cylinders": 30.0}, True),  # an option of one's own that inherits barn
        ({"map": "cold_trial", "world_cylinders": 30.0, "world_family": "barn"}, False),
        ({"map": "hall", "subset": ""}, False),
        ({"map": "indoor_offices", "subset": ""}, False),
    ],
)
def test_barns_worlds_are_known_by_their_name_or_their_cylinders(columns, shown):
    (row,) = summarise(records(**columns), systems={})
    assert ("barn_metric" in row.stats) is ("BARN metric" in to_markdown([row])) is shown
    assert ("barn_metric" in to_csv([row])) is shown
