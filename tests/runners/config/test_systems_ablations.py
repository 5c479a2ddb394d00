"""Ablations: files that set any key, their labels, and the shape that they once had."""

import pytest

from lme.errors import InputError
from runners.config import systems
from runners.config.catalogue import shipped
from runners.config.space import read_space
from runners.evaluate.evaluate import _recorded
from runners.records.episode_record import RunLabels
from runners.records.records import read_episodes
from runners.reports.analysis.summary import summarise
from runners.training.search import search_space
from tests.composing import jobs_of
from tests.made_runs import write_run

FLAT = "# Parameters alone\nc_o: 0.5  # half\nd2: 1.0\n"
WHOLE = """\
# @package _global_
# Fewer candidates, and blind to one check
system: {ablated: with ten candidates}
ablation: {c_t: 0.0}
guide: {candidates: {number: 10}}
"""
INHERITED = "# Two at once\ndefaults: [no_c_h, _self_]\nc_o: 0.5\n"


@pytest.fixture
def own(tmp_path):
    """A user's config folder with an ablation of each shape."""
    (tmp_path / "ablation").mkdir()
    for name, text in (("flat", FLAT), ("whole", WHOLE), ("inherited", INHERITED)):
        (tmp_path / "ablation" / f"{name}.yaml").write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("option", "parameters", "number"),
    [
        ("flat", {"c_o": 0.5, "d2": 1.0}, 300),
        ("whole", {"c_t": 0.0}, 10),
        ("inherited", {"c_h": 0.0, "c_o": 0.5}, 300),
        ("[flat,whole]", {"c_o": 0.5, "d2": 1.0, "c_t": 0.0}, 10),
    ],
)
def test_ablations_of_ones_own_set_parameters_and_keys(own, option, parameters, number):
    with jobs_of(config_dir=own) as job:
        found = job(f"ablation={option}")
    assert found.config.ablation == parameters
    assert {name: found.config.guide["parameters"][name] for name in parameters} == parameters
    assert found.config.guide["candidates"]["number"] == number
    assert found.changes == {}


def test_the_command_line_has_the_last_word(own):
    with jobs_of(config_dir=own) as job:
        found = job("ablation=whole", "guide.candidates.number=20", "ablation.c_t=3")
    assert found.config.guide["parameters"]["c_t"] == 3.0
    assert found.changes == {"guide.candidates.number": 20, "ablation.c_t": 3.0}


def test_labels_are_what_the_files_say(own):
    known = systems.ablation_labels(shipped(own).folders)
    assert known["no_random"] == "without random candidates"
    assert known["whole"] == "with ten candidates"
    assert known["inherited"] == "without c_h"
    assert known["flat"] == "with c_o=0.5, d2=1.0"
    assert "none" not in known
    assert systems.describe_ablation("no_c_o+no_c_t", known) == "without c_o and without c_t"
    assert systems.describe_ablation("no_c_o+flat", known) == "without c_o and with c_o=0.5, d2=1.0"
    assert systems.describe_ablation("no_c_o+gone", known) == systems.describe_ablation("none", known) == ""


def test_a_label_must_be_text(own, says):
    (own / "ablation" / "whole.yaml").write_text(WHOLE.replace("with ten candidates", "[3]"))
    with says.raises(InputError):
        systems.ablation_labels(shipped(own).folders)


def test_a_key_that_an_ablation_sets_is_not_searched():
    words = ("guide=lme_plus", "planner=min_time")
    with jobs_of("train") as job:
        whole, without = search_space(job(*words)), search_space(job(*words, "ablation=no_grip"))
        assert whole == read_space(job(*words).config)
    assert whole.keys() - without.keys() == {"planner.max_lateral_accel"}


@pytest.mark.parametrize(
    ("system", "ablation", "name"),
    [
        ("LME", "none", "LME"),
        ("LME+", "no_memory", "LME+ without memory"),
        ("LME", "no_c_o+no_c_t", "LME without c_o and without c_t"),
        ("LME+ without a_dev", "no_a_dev", "LME+ without a_dev"),  # as once recorded
        ("LME+ without memory", "none", "LME+ without memory"),
        ("LME", "no_longer_there", "LME"),
    ],
)
def test_tables_name_a_system_with_its_ablation(tmp_path, system, ablation, name):
    write_run(tmp_path, system=system, ablation=ablation)
    row, *_ = summarise(read_episodes([tmp_path]))  # published figures may follow
    assert row.name == name


def test_a_table_of_systems_of_which_one_is_gone(tmp_path):
    write_run(tmp_path, system="LME+ without memory")
    rows = summarise(read_episodes([tmp_path]), ["lme_plus", "lme_plus_no_memory"])
    assert [row.name for row in rows] == ["LME+ without memory"]


def test_a_resumed_run_keeps_the_names_of_its_records(tmp_path):
    write_run(tmp_path, system="LME+ without memory", ablation="none", weights="mine")
    columns = ("guide", "planner", "global_map", "robot", "map", "subset", "people")
    now = RunLabels(system="LME+", ablation="no_memory", weights="published", **dict.fromkeys(columns, ""))
    kept = _recorded(now, tmp_path)
    assert (kept.system, kept.ablation, kept.weights) == ("LME+ without memory", "none", "mine")
