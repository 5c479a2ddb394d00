"""The README's own planner, run as a user would: from a file outside the package."""

import json
import re
import sys

import pandas as pd
import pytest

from lme.inputs.resources import resource_dir
from runners.cli.main import main

README = (resource_dir("conf").parent / "README.md").read_text(encoding="utf-8")
MODULE = re.search(r"```python\n(# my_module\.py.*?)```", README, re.DOTALL)[1]
COMMANDS = re.search(r"```sh\n(lme eval planner\._target_.*?)```", README, re.DOTALL)[1].splitlines()
SHORT = ["map.worlds=[0,6]", "runs=1", "tracking=none", "executor=serial"]

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder of a user, from which the command also imports: tests/runners/workers/test_environment.py."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "my_module.py").write_text(MODULE, encoding="utf-8")
    yield tmp_path
    for name in ("my_module", "bad"):
        sys.modules.pop(name, None)


def test_the_planner_of_the_readme_is_about_twenty_lines():
    code = [line for line in MODULE.splitlines() if line.strip() and not line.startswith("#")]
    assert len(code) <= 20


@pytest.mark.parametrize("command", COMMANDS)
def test_the_readmes_commands(folder, command):
    words = command.partition("#")[0].split()[1:]
    assert main([*words, *SHORT]) == 0
    (records,) = folder.glob("outputs/eval/*/episodes.parquet")
    frame = pd.read_parquet(records)
    assert set(frame["planner"]) == {"MyPlanner"}
    assert set(frame["world"]) == {0, 6}
    launch = json.loads((records.parent / "launch.json").read_text())
    assert launch["configs"][0]["planner"] == {
        "_target_": "my_module.MyPlanner",
        **({"speed": 0.8} if "speed" in command else {}),
    }


@pytest.fixture
def mistake(folder, capsys):
    """What a command says of a mistake."""

    def told(*words, status=2):
        assert main(["eval", *words, *SHORT]) == status
        return capsys.readouterr().err

    return told


def test_mistakes_in_a_custom_planner_are_reported(folder, mistake, says):
    says(mistake("planner._target_=my_module.MyPlanner", "+planner.sped=1"))
    says(mistake("planner._target_=my_module.MyPlaner"))
    (folder / "bad.py").write_text(MODULE.replace("2.0 * np", "np.nan * np"), encoding="utf-8")
    said = mistake("planner._target_=bad.MyPlanner")
    assert "step 1: bad.MyPlanner.plan returned" in said
    assert "Traceback" not in said


def test_an_error_of_the_planner_is_shown_where_it_happened_and_ends_its_job_alone(folder, mistake):
    (folder / "bad.py").write_text(MODULE.replace("return self.speed", "return 1 / 0 * self.speed"))
    said = mistake("-m", "planner._target_=bad.MyPlanner", "seed=0,1", status=1)
    assert len(re.findall(r"lme eval: bad\.py:\d+: ZeroDivisionError: division by zero \(", said)) == 2
    assert "Traceback" not in said
    assert "HYDRA_FULL_ERROR" not in said


def refuse(folder, group, name, body):
    """Drive with a class of the user's own as an option of a group, which is refused."""
    part = "from dataclasses import dataclass\n@dataclass\nclass Config:\n    pass\n"
    (folder / "bad.py").write_text(f"{part}class {name}:\n    Config = Config\n{body}")
    own = folder / "mine" / group
    own.mkdir(parents=True)
    (own / f"{name.lower()}.yaml").write_text(f"_target_: bad.{name}\n")
    words = [f"{group}={name.lower()}", "tracking=none", "executor=serial"]
    assert main(["eval", "--config-dir", "mine", *words]) == 2


@pytest.mark.parametrize("group", ["guide", "planner", "map"])
def test_a_class_without_its_methods_is_refused_before_it_runs(folder, capsys, says, group):
    refuse(folder, group, "Bare", "    def __init__(self, config, robot=None):\n        pass\n")
    says(capsys.readouterr().err)


PLANNER = {"__init__": "self, config, robot", "reset": "self, rng", "plan": "self, observation, guidance"}
GUIDE = {**PLANNER, "guide": "self, observation"}
MAP = {"__init__": "self, config", "task": "self, number"}


@pytest.mark.parametrize(
    ("group", "methods"),
    [
        ("planner", {**PLANNER, "__init__": "self, config"}),
        ("planner", {**PLANNER, "plan": "self, o"}),
        ("planner", {**PLANNER, "reset": "self"}),
        ("guide", {**GUIDE, "__init__": "self, config"}),
        ("guide", {**GUIDE, "read_map": "self"}),
        ("guide", {**GUIDE, "explanation": "self, step"}),
        ("map", {**MAP, "__init__": "self"}),
        ("map", {**MAP, "task": "self"}),
    ],
)
def test_a_method_that_takes_other_arguments_is_refused_before_it_runs(folder, capsys, says, group, methods):
    body = "".join(f"    def {name}({arguments}): ...\n" for name, arguments in methods.items())
    refuse(folder, group, "Odd", f"    numbers = (0,)\n{body}")
    says(capsys.readouterr().err)
