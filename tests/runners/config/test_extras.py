"""What is said where an optional package is missing."""

import re
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, requires

import pytest

from lme.errors import InputError
from runners.config import extras
from runners.replay import bags, rerun_file
from runners.workers.cluster import DaskConfig
from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = {
    re.match(r"[\w-]+", requirement)[0]: (extra, requirement)
    for extra, requirements in PROJECT["optional-dependencies"].items()
    for requirement in requirements
    if extra not in ("dev", "docs")
}
SOURCES = [path.read_text(encoding="utf-8") for path in (ROOT / "runners").rglob("*.py")]


@pytest.mark.parametrize("package", OPTIONAL)
def test_a_hint_names_the_package_with_its_bounds(package, monkeypatch):
    extra, requirement = OPTIONAL[package]
    others = [f'{package}-extra>=9; extra == "{extra}"', "numpy>=2.0"]
    monkeypatch.setattr(extras, "requires", lambda name: [*others, f'{requirement}; extra == "{extra}"'])
    assert extras.install(package) == f"pip install '{requirement}'"


def test_the_installed_metadata_has_every_optional_package():
    try:
        requires(extras.DISTRIBUTION)
    except PackageNotFoundError:
        pytest.skip(f"{extras.DISTRIBUTION} is not installed here")
    hints = {package: extras.install(package) for package in OPTIONAL}
    assert hints == {
        package: f"pip install '{requirement}'" for package, (_, requirement) in OPTIONAL.items()
    }


def test_uninstalled_a_hint_names_the_package_alone(monkeypatch):
    def requires(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(extras, "requires", requires)
    assert extras.install("rosbags") == "pip install 'rosbags'"


def test_the_distribution_asked_for_is_ours():
    assert extras.DISTRIBUTION == PROJECT["name"] != "lme"


def test_every_hint_in_the_code_is_of_an_optional_package():
    hinted = {name for text in SOURCES for name in re.findall(r"\binstall\([\"']([\w-]+)[\"']\)", text)}
    assert {"rosbags", "rerun-sdk", "imageio-ffmpeg", "distributed"} <= hinted <= set(OPTIONAL)


def test_nothing_names_an_extra_of_the_other_project():
    files = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "conf").rglob("*.yaml")]
    texts = [*SOURCES, *(path.read_text(encoding="utf-8") for path in files)]
    assert not [text for text in texts if re.search(r"pip install ['\"]?lme\b(?!-nav)|\blme\[\w+\]", text)]


def test_a_replay_without_rosbags_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "metadata.yaml").touch()
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match="needs the package rosbags: pip install 'rosbags"):
        bags.Bag(tmp_path).__enter__()


def test_a_rerun_file_without_its_package_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match="needs the package rerun-sdk: pip install 'rerun-sdk"):
        rerun_file.check_installed()


def test_a_cluster_without_its_package_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="needs the package distributed: pip install 'distributed"):
        DaskConfig()
