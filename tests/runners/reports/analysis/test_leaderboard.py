"""The leaderboard's runs: what shares a cell, what is a repeat, and what tells names apart."""

import json
import math

import pytest

from runners.records import launch_record
from runners.records.launch_record import launch_of, read_launch
from runners.records.run_directories import collect
from runners.reports.analysis import leaderboard
from runners.reports.analysis.leaderboard import UNKNOWN, entries
from tests.composing import jobs_of
from tests.made_runs import write_run


@pytest.fixture
def board(tmp_path):
    """Write runs, each from overrides and from columns of its records, and give the board's entry of each."""

    def made(**runs):
        with jobs_of() as job:
            for name, (words, columns) in runs.items():
                write_run(tmp_path / name, job=None if words is None else job(*words), **columns)
        found = entries(collect([tmp_path / name for name in runs]).frames)
        return {entry.run_dir.name: entry for entry in found}

    return made


def test_a_run_has_its_figures_and_what_it_was_driven_with(board):
    entry = board(one=(["map.worlds=[200,201]", "runs=1"], {"barn_metric": 0.5}))["one"]
    assert entry.system == ("LME", ())
    assert entry.setting == ("barn", "lab100", "jackal", "gazebo", ())
    assert entry.row.stats["success"][0] == 0.5
    assert entry.row.unfinished == ""
    assert entry.metric_interval == (0.5, 0.5)
    assert entry.command == "lme eval"
    assert entry.code.startswith("lme ")
    assert (entry.repeats, entry.shown) == (1, True)


def test_a_run_keeps_its_place_if_the_launch_above_it_is_damaged(board, tmp_path, says):
    (tmp_path / "launch.json").write_text("{")
    with says.warns():
        entry = board(one=([], {}))["one"]
    assert entry.command == "lme eval"


def test_the_large_launch_record_of_a_sweep_is_read_once(board, tmp_path, monkeypatch):
    folders = []

    def counting_read(folder):
        folders.append(folder)
        return read_launch(folder)

    with jobs_of() as job:
        launch_of("eval", [job(), job()], [], True, None).write(tmp_path)
    for module in (launch_record, leaderboard):
        monkeypatch.setattr(module, "read_launch", counting_read)
    board(one=([], {}), two=([], {}), three=([], {}))
    assert folders.count(tmp_path) == 1


def test_other_robots_simulators_and_maps_are_other_settings(board):
    ways = (
        [],
        ["robot.v_max=1"],
        ["sim=physics"],
        ["map.time_limit=50"],
        ["map.worlds=[1]"],
        ["map.worlds=[2]"],
    )
    found = board(**{f"run{number}": (words, {}) for number, words in enumerate(ways)})
    settings = [found[f"run{number}"].setting for number in range(len(ways))]
    assert len(set(settings)) == len(ways)
    assert settings[1].traits[0] == "robot.v_max=1"
    assert settings[2].sim == "physics"
    assert settings[3].traits[0] == "map.time_limit=50"
    assert {entry.system.name for entry in found.values()} == {"LME"}


def test_worlds_tell_settings_of_one_name_apart(board):
    found = board(
        one=(["map.worlds=[1]"], {"subset": "custom"}), two=(["map.worlds=[2]"], {"subset": "custom"})
    )
    assert found["one"].setting.traits == ("map.worlds=[1]",)
    assert found["two"].setting.traits == ("map.worlds=[2]",)


def test_one_world_named_within_two_subsets_is_one_setting(board):
    custom = {"subset": "custom", "worlds": (7,)}
    found = board(
        one=(["map.worlds=[7]", "map.subset=all"], custom),
        two=(["map.worlds=[7]", "map.subset=hard100", "map.count=5"], custom),
        fresh=(["map.worlds=[1000]", "map.subset=fresh"], {**custom, "worlds": (1000,)}),
        hard=(["map.worlds=[1000]", "map.subset=fresh_hard"], {**custom, "worlds": (1000,)}),
    )
    assert found["one"].setting == found["two"].setting
    assert found["one"].repeats == 2
    assert found["fresh"].setting != found["hard"].setting  # other worlds of the same number


def test_a_figure_beside_the_runs_is_one_more_of_them(board):
    """It drives what it draws: the keys of the picture are no part of its system."""
    found = board(
        run=(["map.worlds=[7]", "runs=1", "sim=fast"], {"subset": "custom", "worlds": (7,)}), other=([], {})
    )
    figure = found["run"].run_dir.parent / "figure"
    with jobs_of("figure") as job:
        made = job("figure=trajectories", "world=7", "runs=1")
        write_run(figure, subset="custom", worlds=(7,), job=made, command="figure")
    again = {entry.run_dir.name: entry for entry in entries(collect([figure.parent]).frames)}
    assert {entry.system for entry in again.values()} == {("LME", ())}
    assert again["figure"].setting == again["run"].setting
    assert again["figure"].repeats == 2


def test_changed_keys_of_the_system_are_in_its_name_and_not_in_the_settings(board):
    found = board(
        usual=([], {}),
        changed=(["guide.history_length=4"], {}),
        ablation=(["ablation=no_c_o"], {"ablation": "no_c_o"}),
    )
    assert found["usual"].system.traits == ()
    assert found["changed"].system.traits == ("guide.history_length=4",)
    assert found["ablation"].system == ("LME", ("without c_o",))
    assert found["ablation"].system.name == "LME, without c_o"
    assert len({entry.setting for entry in found.values()}) == 1


def test_a_crowd_is_part_of_the_setting_and_a_filter_and_people_of_the_system(board):
    found = board(
        usual=([], {}),
        crowd=(["crowd=orca", "crowd.density=0.1"], {}),
        force=(["crowd=social_force"], {}),
        filter=(["filter=stopping"], {}),
        margin=(["filter=stopping", "filter.margin=0.05"], {}),
        nobody=(["people=none"], {"people": "none"}),
        tracked=(["people=tracked"], {"people": "tracked"}),
    )
    assert {entry.repeats for entry in found.values()} == {1}
    assert found["usual"].setting.traits == found["usual"].system.traits == ()
    assert found["crowd"].setting.traits == ("crowd orca", "crowd.density=0.1")
    assert found["force"].setting.traits == ("crowd social_force",)
    assert found["crowd"].system == found["force"].system == found["usual"].system
    assert found["filter"].system.name == "LME, filter stopping"
    assert found["margin"].system.name == "LME, filter stopping, filter.margin=0.05"
    assert found["nobody"].system.name == "LME, people none"
    assert found["tracked"].system.name == "LME, people tracked"
    alike = ("usual", "filter", "margin", "nobody", "tracked")
    assert len({found[name].setting for name in alike}) == 1


def test_a_changed_cap_or_ramp_is_part_of_the_system(board):
    found = board(
        usual=([], {}),
        cap=(["cap.v_max=0.5"], {}),
        ramp=(["feedback=CLOSED_LOOP"], {}),
        clocks=(["costmap_clocks=false"], {}),
    )
    assert {entry.repeats for entry in found.values()} == {1}
    assert len({entry.setting for entry in found.values()}) == 1
    assert {name: entry.system.name for name, entry in found.items()} == {
        "usual": "LME",
        "cap": "LME, cap.v_max=0.5",
        "ramp": "LME, feedback=CLOSED_LOOP",
        "clocks": "LME, costmap_clocks=false",
    }


def test_parameters_that_no_name_tells_apart_are_named(board):
    """Weights of two files of one name."""
    found = board(one=([], {}), two=([], {}))
    assert found["one"].system == found["two"].system
    launch = found["two"].run_dir / "launch.json"
    values = json.loads(launch.read_text())
    values["configs"][0]["guide"]["parameters"]["c_t"] = 7
    launch.write_text(json.dumps(values))
    again = {entry.run_dir.name: entry for entry in entries(collect([found["two"].run_dir.parent]).frames)}
    assert again["two"].system.traits == ("guide.parameters.c_t=7",)
    assert again["one"].system != again["two"].system


def test_of_many_keys_that_tell_systems_apart_a_name_shows_the_first(board):
    found = board(one=([], {}), two=([], {}))
    launch = found["two"].run_dir / "launch.json"
    values = json.loads(launch.read_text())
    values["configs"][0]["guide"]["parameters"] |= dict.fromkeys(
        ("a_close", "a_dev", "a_mount", "c_t", "c_h"), 7
    )
    launch.write_text(json.dumps(values))
    again = {entry.run_dir.name: entry for entry in entries(collect([launch.parents[1]]).frames)}
    assert len(again["two"].system.traits) == 5
    last = {name: entry.system.traits[-1] for name, entry in again.items()}
    assert last == {"one": "1 more (no. 1)", "two": "1 more (no. 2)"}


def test_repeats_of_a_job_are_counted_and_the_newest_finished_one_is_shown(board):
    worlds = ["map.worlds=[200,201]", "runs=1"]
    found = board(old=(worlds, {}), new=(worlds, {}), cut=(worlds, {"worlds": (200,)}))
    assert [entry.repeats for entry in found.values()] == [3, 3, 3]
    assert sum(entry.shown for entry in found.values()) == 1
    assert not found["cut"].shown
    assert found["cut"].row.unfinished == "1 of 2 worlds"
    assert not found["new"].same
    assert board(old=(worlds, {}), new=(worlds, {}))["new"].same


def test_another_seed_is_not_a_repeat(board):
    found = board(one=([], {}), two=(["seed=1"], {"seed": 1}))
    assert {entry.repeats for entry in found.values()} == {1}
    assert len({(entry.setting, entry.system) for entry in found.values()}) == 1


def test_runs_of_unknown_origin_share_no_setting(board):
    found = board(one=(None, {}), two=(None, {}))
    assert {entry.setting.sim for entry in found.values()} == {UNKNOWN}
    assert len({entry.setting for entry in found.values()}) == 2
    assert [entry.repeats for entry in found.values()] == [1, 1]
    assert all(entry.started.startswith("20") for entry in found.values())


def test_one_world_has_no_interval_of_the_mean(board):
    assert all(map(math.isnan, board(one=([], {"worlds": (200,)}))["one"].metric_interval))
