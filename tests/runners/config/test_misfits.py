"""An ablation of another guide or planner is named where it does not fit."""

import pytest

from lme.errors import InputError
from runners.config.command_line import compose
from runners.evaluate.evaluate import validate

PLUS = "must go with guide=lme_plus"


def said(*words):
    with pytest.raises(InputError) as caught:
        compose("eval", words, validate)
    return str(caught.value)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["ablation=no_memory"],
            f"ablation=no_memory (LME+ without memory) sets guide.parts, which guide=lme does not have; {PLUS}",
        ),
        (["ablation=[no_c_o,no_memory]"], "ablation=no_memory (LME+ without memory) sets guide.parts, which"),
        (["ablation=no_a_reach"], f"sets guide.parameters.a_reach, which guide=lme does not have; {PLUS}"),
        (["ablation=no_memory", "system=dwa"], f"sets guide.parts, which guide=target does not have; {PLUS}"),
        (["ablation=no_grip"], "sets planner.grip, which planner=simple does not have; must go with planner=min_time"),
        (["-m", "system=lme_plus,lme", "ablation=no_memory"], "ablation=no_memory (LME+ without memory) sets"),
        (
            ["system=lme_plus", "ablation=no_a_close"],
            "guide.parameters.a_close, which guide=lme_plus does not have; must go with guide=lme or guide=lme_printed",
        ),
    ],
)  # fmt: skip
def test_an_ablation_of_another_system(words, message):
    assert message in said(*words)


def test_other_mistakes_beside_it_are_said_as_ever():
    assert said("ablation=no_c_o", "planner.nope=1").startswith("planner.nope: no such key; ")
    assert said("ablation=no_c_o", "ablation.nope=1").startswith("parameter 'nope' is unknown")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("guide: {memori: {kept: false}}", "guide.memori: no such key; "),
        ("guide: {history_length: -1}", "guide.history_length is -1: must be "),
    ],
)
def test_a_mistake_in_an_ablation_of_ones_own_names_its_file(tmp_path, text, message):
    (tmp_path / "ablation").mkdir()
    file = tmp_path / "ablation" / "mine.yaml"
    file.write_text(f"# @package _global_\n# Mine\n{text}\n")
    shown = said("--config-dir", str(tmp_path), "ablation=mine")
    assert shown.startswith(message)
    assert shown.endswith(f"(in {file})")
