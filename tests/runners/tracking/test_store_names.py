"""Names for MLflow: those that it accepts stay, the others differ from all of them."""

import posixpath

import pytest

from runners.tracking.store import KEY_LENGTH, fitting_names, fitting_text

ODD = [
    "success %", "a|b", "Δω [rad/s]", "a//b", "/a", "a/", "..", "../x", ".", "", "...|", "a/./b", "x" * 300, "a\nb",
    "x" * 249 + "/y", "'", "±",
]  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_mlflow_accepts_the_new_name(name):
    from mlflow.utils.validation import _validate_metric_name

    (new,) = fitting_names([name])
    _validate_metric_name(new)
    assert posixpath.normpath(new) == new
    assert 0 < len(new) <= KEY_LENGTH


def test_names_that_mlflow_accepts_stay_and_all_differ():
    good = ["success", "a_b", "Δω", "map: barn/1.5", "x" * KEY_LENGTH]
    found = fitting_names(["a|b", "a%b", *good, *ODD, "x" * 301])
    assert found[2:7] == good
    assert len(set(found)) == len(found)
    assert found[:2] == ["a_b_2", "a_b_3"]


def test_a_text_fits_every_store():
    assert fitting_text("a\0b\udcff", 10) == "a\ufffdb?"
    assert fitting_text("v" * 20, 5) == "v" * 5
