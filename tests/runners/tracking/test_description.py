"""The name, tags and description of a tracked run."""

from pathlib import Path

import pytest

from runners.records.launch_record import Launch
from runners.tracking.description import SWEEP, note, run_name, run_tags
from runners.tracking.store import NAME, NOTE

LABELS = {"system": "LME", "map": "barn", "robot": "jackal", "ablation": "none", "guide": "lme"}
WORDS = ["system=lme", "map=barn", "map.worlds=[0,1]", "executor=serial", "tracking.uri=x", "seed=0,1"]
JOB = [*WORDS[:-1], "seed=1"]


def launched(run_dir, overrides, multirun=False):
    Launch("eval", "", multirun, overrides, configs=[{}]).write(run_dir)


@pytest.mark.parametrize(
    ("tags", "overrides", "of_sweep", "name"),
    [
        (LABELS, (), (), "LME · barn · jackal"),
        ({**LABELS, "command": "eval"}, JOB, (), "LME · barn · jackal · map.worlds=[0,1] · seed=1"),
        ({**LABELS, "command": "eval"}, JOB, WORDS, "LME · barn · jackal · seed=1"),
        ({**LABELS, "ablation": "no_c_o"}, ["+ablation=no_c_o"], (), "LME · barn · jackal · no_c_o"),
        ({**LABELS, "command": "train"}, ["trials=9"], (), "train LME · barn · jackal · trials=9"),
        ({"command": "replay", "bag": "a.mcap"}, ["hydra/launcher=x"], (), "replay a.mcap"),
        ({"command": SWEEP}, WORDS, (), "sweep · system=lme · map=barn · map.worlds=[0,1] · seed=0,1"),
        ({"command": SWEEP}, (), (), ""),
        (LABELS, [f"x={'1' * 99}"], (), f"LME · barn · jackal · x={'1' * 58}…"),
    ],
)
def test_a_run_is_named_for_what_was_driven(tags, overrides, of_sweep, name):
    assert run_name(tags, overrides, of_sweep) == name


def test_a_run_without_labels_is_named_for_its_folder(tmp_path):
    assert run_tags(tmp_path / "day" / "run", {})[NAME] == "day/run"


def test_the_tags_hold_the_commands_that_start_and_resume_it(tmp_path):
    launched(tmp_path, WORDS, multirun=True)
    (tmp_path / "1").mkdir()
    launched(tmp_path / "1", JOB)
    tags = run_tags(tmp_path / "1", {**LABELS, "command": "eval"}, tmp_path)
    assert tags["lme.command"] == (
        "lme eval system=lme map=barn 'map.worlds=[0,1]' executor=serial tracking.uri=x seed=1"
    )
    assert tags["lme.resume"] == f"lme eval resume={tmp_path}/1"
    assert (tags[NAME], tags["mlflow.source.name"]) == ("LME · barn · jackal · seed=1", "lme eval")
    assert tags[NOTE] == note(tags)


def test_a_description_holds_the_table_the_commands_and_the_folder(tmp_path):
    table = tmp_path / "table.md"
    table.write_text("| a |\n| --- |\n")
    tags = {"run_dir": "/runs/1", "lme.command": "lme eval", "lme.resume": "lme eval resume=1"}
    assert note(tags, [Path("other.png"), table]) == (
        "| a |\n| --- |\n\n```sh\nlme eval\nlme eval resume=1\n```\n\nFolder: `/runs/1`"
    )


def test_a_long_table_is_cut_between_its_lines(tmp_path):
    table = tmp_path / "table.md"
    table.write_text("| 12345678 |\n" * 1000)
    text = note({"run_dir": "/runs/1"}, [table])
    assert len(text) < 5000
    assert "| 12345678 |\n\nThe whole table: table.md, among the artifacts.\n" in text
