"""What the documents promise: assumed values are listed, links lead somewhere, Python blocks run."""

import ast
import re
import runpy
from pathlib import Path

import pytest

from tests.places import ROOT

ASSUMED = sorted(
    (path.relative_to(ROOT / "conf"), line.strip().partition(":")[0])
    for path in (ROOT / "conf").rglob("*.yaml")
    for line in path.read_text(encoding="utf-8").splitlines()
    if re.match(r"\s*\w+:.*#.*ASSUMED", line)
)
PAGES = sorted(
    path.relative_to(ROOT)
    for pattern in ("*.md", "docs/*.md", "maps/*.md", "benchmarks/results/*.md")
    for path in ROOT.glob(pattern)
)
NEEDS_FILES = {Path("docs/records.md"), Path("maps/README.md")}  # a run, and the published worlds
BLOCKS = [
    pytest.param(page, code, id=f"{page}-{number}")
    for page in PAGES
    for number, code in enumerate(
        re.findall(
            r"^```python\n(.*?)^```$", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
        )
    )
]
RUNNING = [block for block in BLOCKS if block.values[0] not in NEEDS_FILES]


@pytest.mark.parametrize(("file", "key"), ASSUMED, ids=lambda part: str(part))
def test_every_assumed_value_is_listed(file, key):
    listed = (ROOT / "docs" / "assumptions.md").read_text(encoding="utf-8")
    sections = re.split(r"\n(?=## )", listed)
    assert any(
        f"conf/{file}" in section and re.search(rf"`[\w.]*{key}\b", section) for section in sections
    ), f"conf/{file} marks {key} ASSUMED: docs/assumptions.md must list it"


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_link_leads_somewhere(page):
    text = _without_code((ROOT / page).read_text(encoding="utf-8"))
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]*)?\)", text):
        linked = (ROOT / page).parent / target if target else ROOT / page
        assert linked.exists(), f"{page} links {target}"
        assert not anchor or anchor[1:] in _anchors(linked), f"{page} links {target}{anchor}"


@pytest.mark.parametrize(("page", "code"), BLOCKS)
def test_the_imports_of_every_python_block_are_there(page, code):
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


def test_readmes_snippet_prints_a_subgoal_and_the_reason_for_it(capsys):
    page, code = next(block.values for block in BLOCKS if block.id == "README.md-0")
    exec(compile(code, str(page), "exec"), {})
    assert re.fullmatch(r"\[.+ .+\] first subgoal: .+\n", capsys.readouterr().out)


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$|`[^`\n]+`", "", text, flags=re.DOTALL | re.MULTILINE)


def _anchors(page: Path) -> set[str]:
    """As GitHub makes them of the headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
