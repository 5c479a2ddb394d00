"""Where a mistake comes from: the file of an ablation, or of an option of the user's own."""

import pytest

from lme.errors import InputError
from runners.config.command_line import compose
from runners.evaluate.evaluate import validate


def said(*words):
    with pytest.raises(InputError) as caught:
        compose("eval", words, validate)
    return str(caught.value)


@pytest.mark.parametrize(
    ("words", "message", "ablation"),
    [
        (["ablation=no_memory"], "guide.parts: no such key; ", "no_memory"),
        (["ablation=[no_c_o,no_memory]"], "guide.parts: no such key; ", "no_memory"),
        (["ablation=no_a_reach"], "parameter 'a_reach' is unknown", "no_a_reach"),
        (["ablation=no_memory", "system=dwa"], "guide.parts: no such key; ", "no_memory"),
        (["ablation=no_grip"], "planner.grip: no such key; ", "no_grip"),
        (["-m", "system=lme_plus,lme", "ablation=no_memory"], "guide.parts: no such key; ", "no_memory"),
        (["system=lme_plus", "ablation=no_a_close"], "parameter 'a_close' is unknown", "no_a_close"),
    ],
)
def test_an_ablation_of_another_system(words, message, ablation):
    error = said(*words)
    assert error.startswith(message)
    assert error.endswith(f"conf/ablation/{ablation}.yaml)")


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
