"""What every script in integrations/ keeps to."""

import ast

import pytest

import lme
from tests.integration_scripts import SCRIPTS

GPL = ("robot_sf", "pysocialforce")


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_uses_public_names_alone_and_imports_nothing_under_the_gpl(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    from_ = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not [name for name in plain | from_ if name.startswith(("lme.", "runners"))]
    assert not [name for name in plain | from_ if name.startswith(GPL)]
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "lme"
    }
    assert used <= set(lme.__all__)


@pytest.mark.parametrize("folder", sorted({path.parent for path in SCRIPTS}), ids=lambda folder: folder.name)
def test_a_readme_names_each_script(folder):
    said = (folder / "README.md").read_text(encoding="utf-8")
    assert [path.name for path in folder.glob("*.py") if path.name not in said] == []
