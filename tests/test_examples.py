"""The scripts in examples/ run from any folder, with public names alone, and write where they are called.

The notebook runs in the build of the documentation.
"""

import ast
import json
import os
import re
import subprocess
import sys

import pytest

import lme
import lme.gym
from tests.places import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
LONG = {"train_sb3": ["0.02"]}  # arguments
RUNS = [
    pytest.param(path, marks=[pytest.mark.slow] if path.stem in LONG else [], id=path.stem)
    for path in EXAMPLES
]
ALLOWED = {"lme", "numpy", "matplotlib", "dataclasses", "sys"}
LEARNING = {"collections", "gymnasium", "stable_baselines3", "time", "torch", "typing", "warnings"}
PRINTED = {
    "drive_one_world": r"success after \d+\.\d s and \d+\.\d m\n",
    "escaper_on_a_scan": r"subgoal: .* m ahead, .* m to the left\nreason: first subgoal: .*\n(  \w+: .*\n){6}",
    "train_sb3": r"( +\d+ steps: \d\.\d\d of the last \d+ episodes succeeded\n)*\{'.*\}\n",
    "own_planner": r"success after \d+\.\d s and \d+\.\d m\n",
}
WRITTEN = {"drive_one_world": ["world_218.png"], "train_sb3": ["barn_ppo.onnx", "barn_ppo.zip"]}


@pytest.mark.parametrize("path", RUNS)
def test_an_example_runs_and_writes_where_it_is_called(path, tmp_path):
    if path.stem in LONG:
        pytest.importorskip("stable_baselines3")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, path, *LONG.get(path.stem, [])],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(PRINTED[path.stem], done.stdout), done.stdout
    written = sorted(file.name for file in tmp_path.iterdir())
    assert written == WRITTEN.get(path.stem, [])
    for name in written:
        assert (
            (tmp_path / name).read_bytes().startswith((b"\x89PNG", b"PK", b"\x08"))
        )  # the last: ONNX's version


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_uses_public_names_alone(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    from_ = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    allowed = ALLOWED | (LEARNING if path.stem in LONG else set())
    assert {name.partition(".")[0] for name in plain | from_} <= allowed
    assert not [name for name in plain | from_ if name.startswith("lme.") and name != "lme.gym"]
    envs = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module == "lme.gym"]
    assert {alias.name for node in envs for alias in node.names} <= set(lme.gym.__all__)
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "lme"
    }
    assert used or envs
    assert used <= set(lme.__all__)


def test_the_notebook_is_kept_without_outputs_and_uses_public_names_alone():
    notebook = json.loads((ROOT / "examples" / "records.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert not [cell for cell in cells if cell["outputs"] or cell["execution_count"]]
    code = "\n".join("".join(cell["source"]) for cell in cells if not cell["source"][-1].startswith("!"))
    used = {node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Attribute)}
    names = {node.attr for node in used if isinstance(node.value, ast.Name) and node.value.id == "lme"}
    assert names
    assert names <= set(lme.__all__)


def test_the_page_of_the_examples_lists_them_all():
    listed = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    files = [*EXAMPLES, *(ROOT / "examples").glob("*.ipynb")]
    assert not [path.name for path in files if f"({path.name})" not in listed]
