"""Lessons that a training wrote are read again, and nothing else in their place."""

import os

import pytest

from lme.errors import InputError

clone_training = pytest.importorskip("runners.learning.clone_training", reason="needs torch")


def test_lessons_that_are_a_pipe_or_missing_are_refused(tmp_path):
    pipe = tmp_path / "round_000.npz"
    os.mkfifo(pipe)
    for path, said in ((pipe, "not a regular file"), (tmp_path / "round_001.npz", "is damaged")):
        with pytest.raises(InputError, match=said):
            clone_training._read(path)
