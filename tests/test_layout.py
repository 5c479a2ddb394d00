"""The layout of code and tests, as CONTRIBUTING.md describes it."""

import ast
import functools
import re
from collections import defaultdict
from graphlib import TopologicalSorter
from itertools import takewhile
from pathlib import Path

import pytest

from tests.places import ROOT

PACKAGES = ("lme", "runners")
SOURCES = [path.relative_to(ROOT) for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
TESTS = sorted(
    path.relative_to(ROOT / "tests")
    for package in PACKAGES
    for path in (ROOT / "tests" / package).rglob("test_*.py")
)
SNAPSHOTS = sorted((ROOT / "tests").rglob("__snapshots__/*.ambr"))


def subject_of(test):
    """The module, package or asset that a test file is named for, without its ending; None if there is none."""
    words = test.stem.split("_")[1:]
    names = ("_".join(words[:count]) for count in range(len(words), 0, -1))
    return next((test.with_name(name) for name in names if exists(test.with_name(name))), None)


def exists(place):
    return (ROOT / place / "__init__.py").exists() or any((ROOT / place.parent).glob(f"{place.name}.*"))


def imported(tree):
    """The names of the modules that a module imports, and of what it takes from them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from (node.module, *(f"{node.module}.{name.name}" for name in node.names))
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def run_time_imports(tree):
    """The modules whose code a module needs, also those that one of its functions imports; not those of types alone."""
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in typing_only:
            names = {f"{node.module}.{name.name}" for name in node.names}
            yield from names & MODULES or {node.module}
        elif isinstance(node, ast.Import) and id(node) not in typing_only:
            yield from (name.name for name in node.names)


@functools.cache
def tree_of(path):
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def module_of(path):
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_of(path) for path in SOURCES}


def clients(kernel):
    """The modules of lme that import a kernel."""
    own = [path for path in SOURCES if path.parts[0] == "lme"]
    return [path for path in own if module_of(kernel) in names_of(path)]


@functools.cache
def names_of(path):
    return {*imported(tree_of(path))}


def common_folder(paths):
    folders = [path.parent.parts for path in paths]
    shared = takewhile(lambda level: len(set(level)) == 1, zip(*folders, strict=False))
    return Path(*(level[0] for level in shared))


def test_a_test_file_is_named_for_what_it_tests():
    """That is a module, package or asset in the folder of the same name."""
    assert [str(test) for test in TESTS if not subject_of(test)] == []


@pytest.mark.parametrize("snapshots", SNAPSHOTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_snapshot_belongs_to_a_test(snapshots):
    """Where some tests are deselected, as the slow ones are, syrupy does not report the snapshots of deleted tests."""
    module = snapshots.parents[1] / f"{snapshots.stem}.py"
    names = set(re.findall(r"^# name: (?:Test\w+\.)?(test\w*)", snapshots.read_text("utf-8"), re.MULTILINE))
    assert names <= {
        node.name
        for node in ast.walk(ast.parse(module.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef) and "says" in [argument.arg for argument in node.args.args]
    }


def test_a_name_without_a_module_is_found():
    assert subject_of(Path("lme/navigation/test_episode.py")) == Path("lme/navigation/episode")
    assert subject_of(Path("lme/live/test_driver_clock.py")) == Path("lme/live/driver")
    assert subject_of(Path("lme/planners/test_eband.py")) == Path("lme/planners/eband")
    assert subject_of(Path("runners/reports/explainer/assets/test_page_hands.py")) == Path(
        "runners/reports/explainer/assets/page"
    )
    assert subject_of(Path("lme/live/test_drives.py")) is None


def test_a_public_class_name_stands_for_one_thing():
    places = defaultdict(list)
    for path in SOURCES:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(str(path))
    assert not {name: paths for name, paths in places.items() if len(paths) > 1}


def test_no_module_imports_itself_by_way_of_others():
    """Nor within functions: what two modules need from each other belongs in a third."""
    graph = {module_of(path): {*run_time_imports(tree_of(path))} & MODULES for path in SOURCES}
    TopologicalSorter(graph).prepare()  # raises for a circle, and names it


@pytest.mark.parametrize(
    "kernel",
    [path for path in SOURCES if path.match("lme/geometry/[!_]*.py") or path.match("lme/grids/[!_]*.py")],
    ids=lambda path: path.stem,
)
def test_a_shared_kernel_has_clients_in_several_rooms(kernel):
    found = clients(kernel)
    assert len(found) > 1, f"{kernel} serves {found}"
    assert common_folder(found) in (Path("lme"), kernel.parent), (
        f"{kernel} belongs to {common_folder(found)}/"
    )


@pytest.mark.parametrize(
    "kernel",
    [path for path in SOURCES if path.match("*/kernels.py") | path.match("*/kernels/[!_]*.py")],
    ids=str,
)
def test_a_kernel_next_to_its_client_has_no_other_client(kernel):
    home = kernel.parent.parent if kernel.parent.name == "kernels" else kernel.parent
    outside = [str(path) for path in clients(kernel) if not path.is_relative_to(home)]
    assert not outside, f"{kernel} serves {outside}: lme/geometry/ holds what is shared"
