"""CITATION.cff and the changelog are of the version that the package has."""

import re
import tomllib

import yaml

import lme
from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.load(
    (ROOT / "CITATION.cff").read_text(encoding="utf-8"), yaml.BaseLoader
)  # all values as text
CHANGES = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
REQUIRED = {"cff-version", "message", "title", "authors"}  # by the schema 1.2.0


def test_the_citation_is_of_this_version_and_of_its_day():
    (date,) = re.findall(rf"^## {re.escape(lme.__version__)} - (\d{{4}}-\d\d-\d\d)$", CHANGES, re.MULTILINE)
    assert CITATION.keys() >= REQUIRED
    assert CITATION["cff-version"] == "1.2.0"
    assert (CITATION["version"], CITATION["date-released"]) == (lme.__version__, date)


def test_the_citation_says_what_the_package_says():
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["keywords"] == PROJECT["keywords"]
    assert f"{CITATION['authors'][0]['name']}\n" in (ROOT / "LICENSE").read_text(encoding="utf-8")


def test_the_paper_is_the_one_that_the_readme_names():
    (paper,) = CITATION["references"]
    said = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    names = ", ".join(author["family-names"] for author in paper["authors"])
    assert f"{names}, *{paper['title']}*" in said


def test_changes_to_come_stand_on_top():
    headings = re.findall(r"^## (.+)$", CHANGES, re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert headings[1].startswith(f"{lme.__version__} - ")
    assert set(re.findall(r"^### (.+)$", CHANGES, re.MULTILINE)) <= {
        "Added",
        "Changed",
        "Fixed",
        "Removed",
        "Security",
    }
