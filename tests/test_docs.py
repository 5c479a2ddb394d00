"""What the documents promise: assumed values are listed, links lead somewhere, commands compose, Python blocks run."""

import argparse
import ast
import importlib
import pkgutil
import re
import runpy
import shlex
from collections.abc import Collection
from pathlib import Path

import pytest
import yaml

from lme.guides.lme.weight_files import REGISTERED, WEIGHTS, shipped_weights
from runners.cli import main
from runners.config import catalogue
from tests.builders import PUBLISHED
from tests.places import ROOT

ASSUMED = sorted(
    (path.relative_to(ROOT / "conf"), line.strip().partition(":")[0])
    for path in (ROOT / "conf").rglob("*.yaml")
    for line in path.read_text(encoding="utf-8").splitlines()
    if re.match(r"\s*\w+:.*#.*ASSUMED", line)
)
PAGES = sorted(
    path.relative_to(ROOT)
    for pattern in (
        "*.md",
        "docs/*.md",
        "docs/*/*.md",
        "research/*.md",
        "*/README.md",
        "*/*/README.md",
        "benchmarks/results/*.md",
    )
    for path in ROOT.glob(pattern)
)
NEEDS_FILES = {  # runs, and the published worlds
    Path("docs/reference/records.md"),
    Path("docs/howto/cluster.md"),
    Path("maps/README.md"),
}
COMPOSED = (
    "eval",
    "train",
    "learn",
    "figure",
    "live",
    "play",
    "replay",
)  # from a config; the other commands take files
PARSED = [name for name in main.command_files() if name not in COMPOSED]
BLOCKS = [
    pytest.param(page, code, id=f"{page}-{number}")
    for page in PAGES
    for number, code in enumerate(
        re.findall(
            r"^```python\n(.*?)^```$", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
        )
    )
]
IMPORTED, RUNNING = (
    [block for block in BLOCKS if (block.values[0] in NEEDS_FILES) == needs] for needs in (True, False)
)


def _commands(page: Path, names: Collection[str] = COMPOSED) -> list[tuple[str, ...]]:
    """The words after `lme` of every command in a block, and of those in the text that have a key, with these names."""
    text = (ROOT / page).read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    written = [line.rstrip(" &") for block in blocks for line in block.splitlines()]
    written += [" ".join(inline.split()) for inline in re.findall(r"`(lme (?!live)[^`]*=[^`]*)`", text)]
    found = [re.match(rf"\s*(?:\w+=\S+ )?lme ((?:{'|'.join(names)})(?: .*)?)$", line) for line in written]
    commands = [tuple(shlex.split(each[1], comments=True)) for each in found if each and "…" not in each[1]]
    return [command for command in commands if not {"--help", "system=NAME"} & {*command}]


# Each once, with the first page that has it; the changelog describes former commands.
COMMANDS = {
    command: page for page in reversed(PAGES) if page.name != "CHANGELOG.md" for command in _commands(page)
}


@pytest.mark.parametrize(("file", "key"), ASSUMED, ids=lambda part: str(part))
def test_every_assumed_value_is_listed(file, key):
    listed = (ROOT / "research" / "assumptions.md").read_text(encoding="utf-8")
    sections = re.split(r"\n(?=## )", listed)
    assert any(
        f"conf/{file}" in section and re.search(rf"`[\w.]*{key}\b", section) for section in sections
    ), f"conf/{file} marks {key} ASSUMED: research/assumptions.md must list it"


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_link_leads_somewhere(page):
    text = _without_code((ROOT / page).read_text(encoding="utf-8"))
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]*)?\)", text):
        linked = (ROOT / page).parent / target if target else ROOT / page
        assert linked.exists(), f"{page} links {target}"
        assert not anchor or anchor[1:] in _anchors(linked), f"{page} links {target}{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_a_decimal_begins_with_a_digit(page):
    """0.98, not .98: one style in prose and tables."""
    text = re.sub(r"\]\([^)]*\)|https?://\S+", "", _without_code((ROOT / page).read_text(encoding="utf-8")))
    assert not re.findall(r".*(?<![\w.])\.\d.*", text)


def test_pages_are_short_enough_to_be_read_to_the_end():
    """In words, code and tables included; the reference is looked up, and the research record counts apart."""
    docs = [page for page in PAGES if page.parts[0] == "docs"]
    words = {
        page: len((ROOT / page).read_text(encoding="utf-8").split()) for page in [*docs, Path("README.md")]
    }
    assert words.pop(Path("README.md")) <= 900
    assert sum(words.values()) <= 40_000
    long = {page: count for page, count in words.items() if count > 1_500 and "reference" not in page.parts}
    assert not long


def test_every_page_that_the_search_weighs_is_there():
    """Each name in the patterns of docs/static/scorer.js."""
    scorer = (ROOT / "docs" / "static" / "scorer.js").read_text(encoding="utf-8")
    weighed = [re.compile(pattern) for pattern in re.findall(r"\[/(\^.*)/, ", scorer)]
    pages = [*(str(page.with_suffix("")) for page in PAGES), "docs/reference/config/robot"]
    assert len(weighed) > 2
    for pattern in weighed:
        assert any(pattern.match(page) for page in pages), pattern.pattern
    assert any(pattern.match("CHANGELOG") for pattern in weighed)


@pytest.mark.parametrize(("page", "code"), IMPORTED)
def test_the_imports_of_a_python_block_that_does_not_run_are_there(page, code):
    tree = ast.parse(code)
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    for package in ("rosbags", "gymnasium"):
        if package in code:
            pytest.importorskip(package)
    exec(compile(ast.Module(imports, []), str(page), "exec"), {})


@pytest.mark.parametrize(("page", "code"), RUNNING)
def test_a_python_block_runs_as_it_stands(page, code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for package in ("rosbags", "gymnasium"):
        if package in code:
            pytest.importorskip(package)
    (tmp_path / "block.py").write_text(code, encoding="utf-8")
    runpy.run_path("block.py")
    assert ("print(" in code) == bool(capsys.readouterr().out)


@pytest.fixture
def users_files(tmp_path, monkeypatch):
    """A folder with what the pages tell the reader to write, named by its first comment, and with trained weights."""
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for block in re.findall(r"^```(?:python|yaml)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            named = re.match(r"(?:# @package .*\n)?# ([\w/]+\.(?:py|yaml))", block)
            if named:
                (tmp_path / named[1]).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / named[1]).write_text(block, encoding="utf-8")
    for word in {word for command in COMMANDS for word in command if word.startswith("weights=")}:
        for name in word.removeprefix("weights=").split(","):
            trained = Path(name, WEIGHTS) if "/" in name else REGISTERED / f"{name}.yaml"
            if name not in shipped_weights():
                (tmp_path / trained).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / trained).write_text(yaml.safe_dump({"parameters": PUBLISHED}))
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("page", sorted({*COMMANDS.values()}), ids=str)
def test_every_command_composes(page, users_files, capsys):
    for command in (command for command, first in COMMANDS.items() if first == page):
        status = main.main([*_one_of_its_jobs(command), "--cfg", "job"])
        assert status == 0, f"lme {shlex.join(command)}\n{capsys.readouterr().err}"


def _one_of_its_jobs(command: tuple[str, ...]) -> list[str]:
    """The words with the last value of each that is swept; options before it must exist.

    An experiment of `lme eval` may be a sweep of dozens of configs: one is composed; tests/conf composes them all.
    resume= goes, because its run is not there.
    """
    configs = catalogue.shipped(Path("my_conf"))
    words = []
    for word in command:
        key, _, value = re.sub(r"=range\((?:\d+,)?(\d+)\)$", r"=\1", word).partition("=")
        values = re.split(r",(?![^\[{]*[\]}])", value) if key[0] not in "'-" else [value]
        if key == "experiment":
            assert value.rpartition("/")[2] in configs.choices("experiment", command[0]), f"no {word}"
        if key in configs.groups(command[0]):
            assert {*values[:-1]} <= {*configs.options(key)}, f"no option: {word}"
        if key not in ("resume", "-m", "list"):
            words.append(f"{key}={values[-1]}" if value else word)
        if key == "experiment" and command[0] == "eval":
            words.append("hydra.mode=RUN")
    return words


def test_every_other_command_parses(monkeypatch):
    """Those that take files: `argparse` accepts their words, and then no more is done."""
    parse = argparse.ArgumentParser.parse_known_args

    class AcceptedError(Exception):
        """The words are those of the command."""

    def accept(parser, *given, **more):
        arguments, rest = parse(parser, *given, **more)
        if rest:
            return arguments, rest
        raise AcceptedError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_known_args", accept)
    commands = {words for page in PAGES if page.name != "CHANGELOG.md" for words in _commands(page, PARSED)}
    assert len(commands) > 20
    for name, *words in commands:
        words = words[: words.index(">")] if ">" in words else words
        command = importlib.import_module(f"runners.cli.commands.{name}")
        with pytest.raises(AcceptedError):
            command.main(words)


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=str)
def test_every_dotted_name_leads_to_something(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in re.findall(r"`((?:lme|runners)(?:\.\w+)+)\b[^`]*`", text):
        if not name.endswith(".launch"):  # a file of roslaunch
            pkgutil.resolve_name(name)


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=str)
def test_a_name_of_a_file_is_defined_there(page):
    """`METRICS` of `runners/reports/analysis/summary.py`."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for name, path in re.findall(r"`(\w+)`\s(?:of|in)\s`([\w/]+\.py)`", text):
        code = (ROOT / path).read_text(encoding="utf-8")
        assert re.search(rf"^(?:class |def )?{name}\b", code, re.MULTILINE), f"{page}: no {name} in {path}"


def test_a_decision_prints_a_subgoal_and_the_reason_for_it(capsys):
    page, code = next(block.values for block in BLOCKS if "escaper.decide" in block.values[1])
    exec(compile(code, str(page), "exec"), {})
    assert re.fullmatch(r"\[.+ .+\] first subgoal: .+\n", capsys.readouterr().out)


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$|`[^`\n]+`", "", text, flags=re.DOTALL | re.MULTILINE)


def _anchors(page: Path) -> set[str]:
    """As GitHub makes them of the headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
