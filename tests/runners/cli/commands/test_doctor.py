"""What `lme doctor` reports, and which lines are problems."""

import os
import re
import sys
from importlib.metadata import PackageNotFoundError

import pytest

import lme
from lme import numba_cache, requirements
from runners.cli import main
from runners.cli.commands import doctor

NEEDED = ["numpy>=2.0", "mlflow<4,>=3.10", 'torch>=2.2; extra == "gp"', 'ruff>=0.8; extra == "dev"']
VERSIONS = {"lme-nav": lme.__version__, "numpy": "2.4.6", "mlflow": "3.17.2", "torch": "2.13.0+cpu"}


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Versions of a machine in good order, by package; a folder of its own, and no variable set."""
    versions = dict(VERSIONS)

    def version(package):
        if package not in versions:
            raise PackageNotFoundError(package)
        return versions[package]

    monkeypatch.setattr(requirements, "requires", lambda name: NEEDED)
    monkeypatch.setattr(doctor, "version", version)
    monkeypatch.setattr(doctor, "metadata", lambda name: {"Requires-Python": ">=3.11,<3.14"})
    monkeypatch.setattr(doctor, "WORKER_GB", 1e-6)
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.chdir(tmp_path)
    return versions


@pytest.fixture
def unwritable(monkeypatch):
    """Places that cannot be written: permissions do not bind root, so the question is answered."""
    places = set()
    ask = os.access
    monkeypatch.setattr(
        doctor.os,
        "access",
        lambda path, mode: ask(path, mode) and not (mode & os.W_OK and str(path) in places),
    )
    return places


def line(name):
    (found,) = (each for each in doctor.report() if each.name == name)
    return found


def test_a_machine_in_good_order(installed, tmp_path, capsys):
    assert main.main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert re.search(rf"^  lme +{re.escape(lme.__version__)}, ", shown, re.M)
    assert re.search(r"^  numpy +2\.4\.6$", shown, re.M)
    assert re.search(r"^  extra gp +yes, torch 2\.13\.0\+cpu$", shown, re.M)
    assert re.search(rf"^  outputs +{re.escape(str(tmp_path / 'outputs'))}, writable$", shown, re.M)
    assert re.search(
        rf"^  MLflow store +{re.escape(str(tmp_path))}/outputs/mlflow\.db, writable$", shown, re.M
    )
    assert shown.endswith("\nNo problems.\n")
    assert "ruff" not in shown
    assert list(tmp_path.iterdir()) == []  # a report writes nothing


def test_a_problem_is_marked_says_what_to_do_and_is_the_exit_status(installed, capsys):
    installed["numpy"] = "1.26.4"
    del installed["mlflow"]
    assert main.main(["doctor"]) == 1
    shown = capsys.readouterr().out
    assert re.search(r"^! numpy +1\.26\.4\n +pip install 'numpy>=2\.0'$", shown, re.M)
    assert re.search(r"^! mlflow +missing\n +pip install 'mlflow<4,>=3\.10'$", shown, re.M)
    assert shown.endswith("\n2 problems.\n")


def test_a_missing_extra_is_not_a_problem_but_an_old_one_is(installed):
    del installed["torch"]
    assert line("extra gp") == ("extra gp", "no; pip install 'torch>=2.2'", "")
    installed["torch"] = "1.13.1"
    assert line("extra gp") == ("extra gp", "yes, torch 1.13.1", "pip install 'torch>=2.2'")


def test_metadata_that_are_missing_or_of_another_version(installed, says):
    installed["lme-nav"] = "0.0.1"
    says(line("lme").advice)
    del installed["lme-nav"]
    says(line("lme").advice)


def test_doctor_names_an_unsupported_python(installed, monkeypatch):
    monkeypatch.setattr(doctor.platform, "python_version", lambda: "3.14.1")
    assert line("Python").advice.startswith("must be >=3.11,<3.14")


def test_little_memory(installed, tmp_path, monkeypatch):
    (tmp_path / "meminfo").write_text("MemTotal: 2097152 kB\nMemAvailable: 1048576 kB\n")
    monkeypatch.setattr(doctor, "WORKER_GB", 0.3)
    for cores, advice in ((3, ""), (4, "little for 4 worker processes: try executor.workers=3")):
        monkeypatch.setattr(doctor, "available_cores", lambda cores=cores: cores)
        assert doctor._memory(tmp_path / "meminfo") == [("memory", "2.0 GB, 1.0 GB available", advice)]
    assert doctor._memory(tmp_path / "none") == []


def test_folders_that_cannot_be_written(installed, unwritable, tmp_path, monkeypatch, says):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba_cache"))
    unwritable.add(str(tmp_path))
    says(line("outputs").advice)
    assert line("MLflow store").advice.startswith("set MLFLOW_TRACKING_URI")
    assert line("Numba cache").advice.startswith("set NUMBA_CACHE_DIR")


def test_a_file_in_the_place_of_a_folder_and_a_store_that_is_read_only(installed, unwritable, tmp_path):
    (tmp_path / "outputs").mkdir()
    (tmp_path / "outputs" / "mlflow.db").touch()
    unwritable.add(str(tmp_path / "outputs" / "mlflow.db"))
    assert not line("outputs").advice
    assert line("MLflow store").advice
    (tmp_path / "outputs" / "mlflow.db").unlink()
    (tmp_path / "outputs").rmdir()
    (tmp_path / "outputs").touch()
    assert line("outputs").advice


@pytest.mark.parametrize(
    ("uri", "found", "is_right"),
    [
        ("http://me:secret@host:5000", "http://me:***@host:5000, not asked", True),
        ("https://secret@host:5000", "https://***@host:5000, not asked", True),
        ("mysql://me:se/cret@ho@host/runs", "mysql://me:***@host/runs, not asked", True),
        ("databricks://profile", "databricks://profile, not asked", True),
        ("postgres://me:secret@host/runs", "postgres://me:***@host/runs", False),
        ("outputs", "outputs", False),
    ],
)
def test_stores_on_a_server_are_not_contacted_and_no_password_is_shown(
    installed, monkeypatch, uri, found, is_right
):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    store = line("MLflow store")
    assert store.found == found
    assert (not store.advice) == is_right
    assert "secret" not in store.advice


@pytest.mark.parametrize("compiled", [False, True])
def test_whether_the_kernels_are_compiled(installed, monkeypatch, compiled):
    installed["numba"] = "0.68.1"
    monkeypatch.setattr(numba_cache, "compiled", lambda: compiled)
    assert (line("Numba cache").found.endswith("writable, warm"), line("Numba cache").advice) == (
        compiled,
        "",
    )


def test_the_real_metadata_name_every_requirement():
    if not doctor.needed():
        pytest.skip("lme-nav is not installed here")
    assert {"numpy", "numba", "hydra-core", "optuna", "pymunk", "mlflow", "pandas"} <= {
        each.name for each in doctor.needed()
    }
    assert set(doctor.optional()) == {
        "cluster",
        "cmaes",
        "gp",
        "gym",
        "learn",
        "mujoco",
        "play",
        "replay",
        "rerun",
        "shared",
        "slurm",
        "video",
    }
    assert sys.executable in line("Python").found
