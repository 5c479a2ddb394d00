"""What waits for a module is called once, whichever of the two comes first."""

import importlib
import sys

import pytest

from lme.after_import import after_import


@pytest.fixture
def late(tmp_path, monkeypatch):
    """A module that has not been imported."""
    (tmp_path / "late_module.py").write_text("value = 3\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    yield "late_module"
    sys.modules.pop("late_module", None)


def test_it_waits_for_the_import_and_sees_the_whole_module(late):
    seen = []
    after_import(late, lambda module: seen.append(module.value))
    after_import(late, lambda module: seen.append("again"))  # who waits already is enough
    assert seen == []
    importlib.import_module(late)
    assert seen == [3]


def test_an_imported_module_is_acted_on_at_once(late):
    seen = []
    importlib.import_module(late)
    after_import(late, lambda module: seen.append(module.value))
    assert seen == [3]
