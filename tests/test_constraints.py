"""`constraints.txt`: the tested version of every package that `pyproject.toml` asks for, within its bounds."""

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
ASKED = [
    *PROJECT["dependencies"],
    *(each for extra in PROJECT["optional-dependencies"].values() for each in extra),
]
PINNED = [
    line for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines() if not line.startswith("#")
]
VERSIONS = {canonicalize_name(name): version for name, version in (line.split("==") for line in PINNED)}


@pytest.mark.parametrize("text", sorted(set(ASKED)))
def test_what_the_project_asks_for_has_a_tested_version(text):
    requirement = Requirement(text)
    if canonicalize_name(requirement.name) == PROJECT["name"]:
        return  # an extra that takes another one in
    assert VERSIONS[canonicalize_name(requirement.name)] in requirement.specifier


def test_the_versions_name_no_place():
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.]*", line) for line in PINNED)
    assert len(VERSIONS) == len(PINNED)
