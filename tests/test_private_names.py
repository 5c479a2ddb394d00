"""Private names of Hydra and Optuna are in one file each, which says why."""

import ast
import re

import pytest

from tests.places import ROOT

SOURCES = [path for room in ("lme", "runners") for path in sorted((ROOT / room).rglob("*.py"))]
HYDRA, OPTUNA = "runners/cli/hydra_jobs.py", "runners/training/optuna_private.py"
# Attributes of Optuna's own objects: of a study, a trial, a storage, a sampler.
ATTRIBUTES = {
    "_trial_id",
    "_study_id",
    "_storage",
    "_backend",
    "_sampler",
    "_cached_frozen_trial",
    "_thread_local",
}


def modules(path):
    """Every dotted name that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{name.name}" for name in node.names)


def is_private(module):
    return bool(re.match(r"(hydra|optuna)\..*\b_", module))


def attributes(path):
    """Private attributes of Optuna's objects; those of `self` are a class's own."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr in ATTRIBUTES and ast.unparse(node.value) != "self":
            yield node.attr


def test_hydras_private_part_is_imported_in_one_file():
    found = {path.relative_to(ROOT).as_posix() for path in SOURCES if any(map(is_private, modules(path)))}
    assert found == {HYDRA}


def test_optunas_private_names_are_used_in_one_file():
    found = {path.relative_to(ROOT).as_posix() for path in SOURCES if list(attributes(path))}
    assert found == {OPTUNA}


@pytest.mark.parametrize("file", [HYDRA, OPTUNA])
def test_the_file_says_why(file):
    text = (ROOT / file).read_text(encoding="utf-8")
    reason = ast.get_docstring(ast.parse(text)) or ""
    used = {name.split(".")[-1] for name in modules(ROOT / file) if is_private(name)} | {
        *attributes(ROOT / file)
    }
    assert used
    assert all(f"`{name}`" in reason for name in used)
