"""What is said of optional packages, and that the two installations require what they should."""

import ast
import re
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, requires

import pytest

from lme import requirements
from tests.places import ROOT

WHOLE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ROBOTS = tomllib.loads((ROOT / "lme" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXPERIMENTS = {
    "hydra-core",
    "jinja2",
    "matplotlib",
    "mlflow",
    "onnx",
    "onnxruntime",
    "optuna",
    "packaging",
    "pandas",
    "pyarrow",
    "rich",
}
MODULES = {"pillow": "PIL", "pyyaml": "yaml"}  # where the module has another name than the package


def name(requirement):
    return re.match(r"[\w-]+", requirement)[0]


def by_extra(project):
    """Extra and requirement of each optional package."""
    extras = project["optional-dependencies"].items()
    return {
        name(each): (extra, each) for extra, named in extras for each in named if extra not in ("dev", "docs")
    }


OPTIONAL = {**by_extra(ROBOTS), **by_extra(WHOLE)}


@pytest.mark.parametrize("package", OPTIONAL)
def test_a_hint_names_the_package_with_its_bounds(package, monkeypatch):
    extra, requirement = OPTIONAL[package]
    others = [f'{package}-extra>=9; extra == "{extra}"', "numpy>=2.0"]
    monkeypatch.setattr(
        requirements, "requires", lambda name: [*others, f'{requirement}; extra == "{extra}"']
    )
    assert requirements.install(package) == f"pip install '{requirement}'"


def test_a_hint_names_several_packages(monkeypatch):
    monkeypatch.setattr(requirements, "requires", lambda name: ["onnx>=1.16", "onnxruntime>=1.18"])
    assert requirements.install("onnx", "onnxruntime") == "pip install 'onnx>=1.16' 'onnxruntime>=1.18'"


def test_the_installed_metadata_have_every_optional_package():
    try:
        requires(requirements.DISTRIBUTION)
    except PackageNotFoundError:
        pytest.skip(f"{requirements.DISTRIBUTION} is not installed here")
    expected = {package: requirement for package, (_, requirement) in by_extra(WHOLE).items()}
    assert {package: requirements.install(package) for package in expected} == {
        package: f"pip install '{requirement}'" for package, requirement in expected.items()
    }


def test_uninstalled_a_hint_names_the_package_alone(monkeypatch):
    def requires(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(requirements, "requires", requires)
    assert requirements.install("rosbags") == "pip install 'rosbags'"


def test_both_installations_share_one_name_and_it_is_not_lme():
    """So pip replaces the one by the other: they hold the same files."""
    assert requirements.DISTRIBUTION == WHOLE["name"] == ROBOTS["name"] != "lme"


def test_the_installation_for_robots_leaves_out_what_only_experiments_need():
    assert {*map(name, WHOLE["dependencies"])} - {*map(name, ROBOTS["dependencies"])} == EXPERIMENTS
    everything = [*WHOLE["dependencies"], *(each for _, each in by_extra(WHOLE).values())]
    assert set(ROBOTS["dependencies"]) <= set(WHOLE["dependencies"])
    assert {each for _, each in by_extra(ROBOTS).values()} <= set(everything)
    assert ROBOTS["requires-python"] == WHOLE["requires-python"]


def test_the_installation_for_robots_requires_what_the_library_imports():
    optional = ROBOTS["optional-dependencies"]
    extras = [*optional["gym"], *optional["mujoco"], *optional["onnx"]]
    packages = [*ROBOTS["dependencies"], *extras]
    assert imported(ROOT / "lme") == {MODULES.get(name(each), name(each)) for each in packages}


def imported(folder):
    """The modules of others that the files of a folder import anywhere."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module)
    return {each.partition(".")[0] for each in found} - {*sys.stdlib_module_names, "lme", "runners"}
