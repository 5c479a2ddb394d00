"""Names of learned weights: whether they can be written is known before a training begins."""

import os

import pytest

from lme.errors import InputError
from runners.records.weight_file import check_name


@pytest.mark.parametrize("there", ["", "outputs", "outputs/weights"])
def test_a_folder_that_cannot_be_written_is_reported_before_anything_runs(tmp_path, monkeypatch, there, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / there).mkdir(parents=True, exist_ok=True)
    check_name("mine", ".yaml", "a weight set", ())
    monkeypatch.setattr(os, "access", lambda path, mode: path.resolve() != tmp_path / there)
    with says.raises(InputError):
        check_name("mine", ".yaml", "a weight set", ())
    assert list(tmp_path.rglob("*.yaml")) == []
