"""The scripts in examples/ run from any folder, with public names alone, and write where they are called."""

import ast
import os
import re
import subprocess
import sys

import pytest

import lme
from tests.places import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
ALLOWED = {"lme", "numpy", "matplotlib", "dataclasses", "sys"}
PRINTED = {
    "drive_one_world": r"success after \d+\.\d s and \d+\.\d m\n",
    "escaper_on_a_scan": r"subgoal: .* m ahead, .* m to the left\nreason: first subgoal: .*\n(  \w+: .*\n){6}",
    "own_planner": r"success after \d+\.\d s and \d+\.\d m\n",
}
WRITTEN = {"drive_one_world": ["world_218.png"]}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_writes_where_it_is_called(path, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, path], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(PRINTED[path.stem], done.stdout), done.stdout
    written = sorted(file.name for file in tmp_path.iterdir())
    assert written == WRITTEN.get(path.stem, [])
    for name in written:
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_uses_public_names_alone(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    from_ = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in plain | from_} <= ALLOWED
    assert not [name for name in plain | from_ if name.startswith("lme.")]
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "lme"
    }
    assert used
    assert used <= set(lme.__all__)
