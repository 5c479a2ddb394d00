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
    ("words", "ablation"),
    [
        (["ablation=no_memory"], "no_memory"),
        (["ablation=[no_c_o,no_memory]"], "no_memory"),
        (["ablation=no_a_reach"], "no_a_reach"),
        (["ablation=no_memory", "system=dwa"], "no_memory"),
        (["ablation=no_grip"], "no_grip"),
        (["-m", "system=lme_plus,lme", "ablation=no_memory"], "no_memory"),
        (["system=lme_plus", "ablation=no_a_close"], "no_a_close"),
    ],
    ids=str,
)
def test_an_ablation_of_another_system(words, ablation, says):
    error = said(*words)
    says(error)
    assert error.endswith(f"conf/ablation/{ablation}.yaml)")


def test_other_mistakes_beside_it_are_said_as_ever(says):
    says(said("ablation=no_c_o", "planner.nope=1"))
    says(said("ablation=no_c_o", "ablation.nope=1"))


@pytest.mark.parametrize(
    "text",
    [
        "guide: {memori: {kept: false}}",
        "guide: {history_length: -1}",
    ],
)
def test_a_mistake_in_an_ablation_of_ones_own_names_its_file(tmp_path, text, says):
    (tmp_path / "ablation").mkdir()
    file = tmp_path / "ablation" / "mine.yaml"
    file.write_text(f"# @package _global_\n# Mine\n{text}\n")
    shown = said("--config-dir", str(tmp_path), "ablation=mine")
    says(shown)
    assert shown.endswith(f"(in {file})")


def test_a_polygon_as_a_footprint(tmp_path, says):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "mine.yaml").write_text(
        "defaults: [jackal, _self_]\nname: mine\nfootprint: [[0.25, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.25, -0.2]]\n"
    )
    says(said(f"--config-dir={tmp_path}", "robot=mine"))


def test_an_odd_value_is_said_once(recwarn):
    compose("eval", ["robot.alpha_v=0.01", "map.worlds=[0]", "sim=fast"], validate)
    texts = [str(warning.message) for warning in recwarn if "alpha_v" in str(warning.message)]
    assert texts == ["robot.alpha_v is 0.01 m/s²: it is usually from 0.05 to 50 m/s²"]
