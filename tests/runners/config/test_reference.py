"""The config reference of the documentation: nothing of the catalogue is missing, and types are the dataclasses'."""

import re
import subprocess
import sys

import pytest

from runners.config import catalogue, reference, schema
from tests.places import ROOT

CATALOGUE = catalogue.shipped()


@pytest.fixture(scope="module")
def pages():
    return reference.pages()


def test_there_is_a_page_for_every_group_of_conf(pages):
    folders = {folder.name for folder in catalogue.shipped().folders[0].iterdir() if folder.is_dir()}
    assert set(pages) == {"commands", *folders - {"network", "weight_set"}}


def test_the_pages_of_the_checkout_are_up_to_date(pages):
    """They are committed so that the reference can be read without building the site."""
    written = {page.stem: page.read_text(encoding="utf-8") for page in reference.FOLDER.glob("*.md")}
    assert written == pages, "python -m runners.config.reference writes them anew"
    listed = (reference.FOLDER.parent / "config.md").read_text(encoding="utf-8")
    assert all(f"(config/{name}.md)" in listed for name in pages)


@pytest.mark.parametrize("command", schema.COMMANDS)
def test_every_key_of_a_command_is_in_its_section(pages, command):
    section = _sections(pages["commands"])[f"lme {command}"]
    for key in CATALOGUE.keys(command):
        assert f"| `{key.name}` | `{key.value}` |" in section
        assert key.comment in section.replace("\\", "")


def test_every_key_of_every_option_is_in_its_section(pages):
    for group in set(pages) - {"commands", "experiment", "system"}:
        sections = _sections(pages[group])
        for option in CATALOGUE.options(group):
            for key in CATALOGUE.keys(f"{group}/{option}"):
                assert key.name == "_target_" or f"| `{key.name}` |" in sections[option], f"{group}={option}"


def test_options_in_folders_are_listed(pages):
    assert "| `figure/task` | " in pages["experiment"]
    assert "## planner/dwa" in pages["space"]


@pytest.mark.parametrize(
    ("group", "row"),
    [
        ("planner", "| `alpha_v` | `null` | a number or null | "),
        ("robot", "| `footprint.radius` | `0.2` | a number or null | "),
        ("map", "| `worlds` | `null` | a list, each a whole number or null | "),
        ("learner", r"| `reward.progress` | `2.0` | a number | \[1/m] per metre nearer to the goal |"),
        ("planner", r"| `custom` | Your own class: planner.\_target\_=my\_module.MyPlanner; "),
    ],
)
def test_a_row_has_default_type_and_comment(pages, group, row):
    assert row in pages[group]


def test_the_reference_needs_no_torch(pages):
    """Nor does the site: `pip install -e '.[docs]'` does not bring it."""
    code = (
        "import sys; sys.modules['torch'] = None; from runners.config import reference; "
        "print(reference.pages()['learner'], end='')"
    )
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout == pages["learner"]


def test_no_cell_breaks_its_table(pages):
    for text in pages.values():
        for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
            columns = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
            assert len(columns) == 1, table


def _sections(text):
    return {part.partition("\n")[0]: part for part in text.split("\n## ")[1:]}
