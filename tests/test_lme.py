"""The names that `import lme` gives."""

import ast
import importlib.metadata
import re
import subprocess
import sys

import numpy as np
import pytest

import lme
from tests.places import ROOT

PAGE = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `(\w+)` \| (.+?) \| `(.+)` \|$", PAGE, re.MULTILINE)
HEAVY = {"hydra", "omegaconf", "numba", "numpy", "pandas", "scipy", "mlflow", "matplotlib", "optuna", "yaml"}


@pytest.mark.parametrize("name", [name for name in lme.__all__ if name != "__version__"])
def test_every_name_imports_and_says_what_it_is(name):
    public = getattr(lme, name)
    assert public.__name__ == name
    assert public.__module__.startswith("lme.")
    assert public.__doc__.strip()


def test_the_page_lists_every_name_once():
    assert sorted(name for name, _, _ in ROWS) == sorted(lme.__all__)


def test_type_checkers_see_the_same_names():
    tree = ast.parse((ROOT / "lme" / "__init__.py").read_text(encoding="utf-8"))
    ifs = [node for node in tree.body if isinstance(node, ast.If)]
    (block,) = [node for node in ifs if getattr(node.test, "id", "") == "TYPE_CHECKING"]
    seen = {alias.asname: line.module for line in block.body for alias in line.names}
    assert seen == lme._MODULES


def test_the_examples_on_the_page_are_right():
    names = {name: getattr(lme, name) for name in lme.__all__} | {"lme": lme, "np": np}
    names |= {"robot": lme.load_robot("jackal"), "parameters": lme.load_parameters("published")}
    names |= {"footprint": lme.Footprint(radius=0.2), "lidar": lme.Lidar(360, 6.28, 0.1, 10.0)}
    names |= {"pose": lme.Pose(0.0, 0.0, 0.0), "twist": lme.Twist(0.0, 0.0), "target": np.array([5.0, 0.0])}
    names |= {"circles": [[1.5, 0.2, 0.3]], "segments": [[3.0, -1.0, 3.0, 1.0]]}
    names |= {"ranges": np.full(360, np.inf, dtype=np.float32), "rng": np.random.default_rng(0)}
    results = {
        "LaserScan": "scan",
        "Observation": "observation",
        "LocalMinimumEscaper": "escaper",
        "Lme": "guide",
    }
    results |= {"Simple": "planner", "Navigator": "navigator", "Barn": "task", "FastSimulator": "simulator"}
    todo = {name: example for name, _, example in ROWS if name != "InputError"}
    order = ["LaserScan", "Observation", "LocalMinimumEscaper", *todo]
    for name in dict.fromkeys(order):
        value = eval(todo[name], names)
        names[results.get(name, "_")] = value
        if name == "LocalMinimumEscaper":
            value.decide(names["observation"])
        if isinstance(names[name], type) and name != "Barn":
            assert isinstance(value, names[name])


def test_nothing_heavy_is_imported_before_it_is_used():
    code = f"import sys, lme; print({HEAVY!r} & set(sys.modules), lme.__version__); lme.InputError; lme.Barn"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"set() {lme.__version__}\n"


def test_the_library_needs_none_of_the_runners_packages():
    code = (
        f"import sys, lme; [getattr(lme, name) for name in lme.__all__]; print({HEAVY!r} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60)
    loaded = ast.literal_eval(done.stdout)
    assert loaded <= {"numpy", "numba", "yaml", "scipy"}


def test_a_name_that_is_not_there(says):
    with says.raises(AttributeError):
        lme.Robto  # noqa: B018
    assert set(lme.__all__) <= set(dir(lme))


def test_the_version_is_the_distributions():
    try:
        assert importlib.metadata.version("lme-nav") == lme.__version__
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("lme-nav is not installed here")
