"""What the documents promise about the configs."""

import re

import pytest

from tests.places import ROOT

ASSUMED = sorted(
    (path.relative_to(ROOT / "conf"), line.strip().partition(":")[0])
    for path in (ROOT / "conf").rglob("*.yaml")
    for line in path.read_text(encoding="utf-8").splitlines()
    if re.match(r"\s*\w+:.*#.*ASSUMED", line)
)


@pytest.mark.parametrize(("file", "key"), ASSUMED, ids=lambda part: str(part))
def test_every_assumed_value_is_listed(file, key):
    listed = (ROOT / "docs" / "assumptions.md").read_text(encoding="utf-8")
    sections = re.split(r"\n(?=## )", listed)
    assert any(
        f"conf/{file}" in section and re.search(rf"`[\w.]*{key}\b", section) for section in sections
    ), f"conf/{file} marks {key} ASSUMED: docs/assumptions.md must list it"


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_every_linked_file_is_there(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (ROOT / target).exists(), f"{name} links {target}"
