"""The wheel carries all it needs: configs and maps, found from anywhere."""

import os
import subprocess
import sys
import zipfile

import pytest

from tests.places import ROOT


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    return next(out.glob("*.whl"))


@pytest.mark.slow
def test_every_config_and_map_is_in_the_wheel(wheel):
    packed = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("conf", "maps"):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                assert f"lme/_data/{path.relative_to(ROOT)}" in packed
    for path in (ROOT / "runners" / "reports" / "explainer" / "assets").rglob("*.*"):
        assert str(path.relative_to(ROOT)) in packed
    assert {"runners/reports/paper/main.tex", "lme/_data/CITATION.cff"} <= packed
    assert {"lme/py.typed", "runners/py.typed"} <= packed
    assert "lme/pyproject.toml" not in packed  # of the installation for robots


@pytest.mark.slow
def test_the_installation_for_robots_has_the_same_files(wheel, tmp_path):
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(ROOT / "lme")]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    (small,) = tmp_path.glob("*.whl")
    assert _packed(small) == _packed(wheel)


def _packed(wheel):
    """Its files and their checksums, without those that describe the wheel."""
    files = zipfile.ZipFile(wheel).infolist()
    return {(file.filename, file.CRC) for file in files if ".dist-info/" not in file.filename}


@pytest.mark.slow
def test_an_installed_wheel_runs_from_another_directory(wheel, tmp_path):
    environment = tmp_path / "env"
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run([sys.executable, "-m", "venv", environment], check=True, timeout=300)
    install = [environment / "bin" / "pip", "install", "--quiet", wheel]
    subprocess.run(install, check=True, timeout=1200, env=clean)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    command = [environment / "bin" / "lme", "eval", "map=barn", "runs=1"]
    done = subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, timeout=600, env=clean)
    assert done.returncode == 0, done.stderr
    (table,) = elsewhere.glob("outputs/eval/*/table.md")
    assert "| LME |" in table.read_text()
    assert "| LME (published) |" in table.read_text()
