"""Whose code raised an error, and what is said of it."""

import functools
import importlib
import inspect
import sys

import numba
import pytest

from lme.errors import InputError, require
from lme.geometry.frames import to_world
from lme.inputs.user_code import check_call, explained, import_module, show_traceback, user_error


@pytest.fixture
def write(tmp_path, monkeypatch):
    """A function that writes a user's module, of which nothing is left afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    before = {*sys.modules}

    def written(name, text):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
        importlib.invalidate_caches()
        return name

    yield written
    for name in {*sys.modules} - before:
        del sys.modules[name]


def raised(function, *arguments):
    """What a function raises."""
    with pytest.raises((Exception, SystemExit)) as caught:
        function(*arguments)
    error = caught.value
    return error.with_traceback(error.__traceback__.tb_next)  # as lme sees it: without this file


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("1 / 0", "own.py:4: ZeroDivisionError: division by zero"),
        ("raise ValueError", "own.py:4: ValueError"),
        ("raise ValueError('two\\nlines')", "own.py:4: ValueError: two lines"),
        ("raise Own('mine')", "own.py:4: own.Own: mine"),
        ("raise SystemExit(0)", "own.py:4: SystemExit: 0"),
        ("np.linalg.inv(np.zeros((2, 2)))", "own.py:4: numpy.linalg.LinAlgError: Singular matrix"),
        ("np.random.default_rng(0).normal(0.0, -1.0)", "own.py:4: ValueError: scale < 0"),
        ("import nosuchmodule", "own.py:4: ModuleNotFoundError: No module named 'nosuchmodule'"),
        ("compile('(', '<text>', 'exec')", "own.py:4: SyntaxError: '(' was never closed"),
    ],
)
def test_the_file_the_line_and_the_error_are_named(write, body, said):
    write("own", f"import numpy as np\nclass Own(Exception): ...\ndef plan():\n    {body}\n")
    error = raised(importlib.import_module("own").plan)
    assert user_error(error) == said
    assert explained(error) == f"{said} (LME_TRACEBACK=1 shows the traceback)"


def test_the_innermost_line_of_the_user_is_named_and_where_lme_raised(write):
    write("helper", "from lme.geometry.frames import to_world\ndef help():\n    to_world(None, None)\n")
    write("own", "import helper\ndef plan():\n    helper.help()\n")
    said = user_error(raised(importlib.import_module("own").plan))
    assert said.startswith("helper.py:3: ")
    assert "raised in " in said
    assert "frames.py:" in said


def test_an_error_of_lme_and_an_input_error_are_not_the_users(write):
    assert user_error(raised(to_world, None, None)) == explained(raised(to_world, None, None)) == ""
    write("own", "from lme.errors import require\ndef plan():\n    require('x', -1.0, above=0.0)\n")
    assert isinstance(raised(importlib.import_module("own").plan), InputError)
    assert user_error(raised(importlib.import_module("own").plan)) == ""
    assert user_error(raised(require, "x", None)) == ""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\ny = undefined\n", "own.py:2: NameError: name 'undefined' is not defined"),
        ("def f(:\n", "own.py:1: SyntaxError: "),
        ("if True:\nx = 1\n", "own.py:2: IndentationError: "),
        ("import nosuchmodule\n", "own.py:1: ModuleNotFoundError: No module named 'nosuchmodule'"),
        ("import sys\nsys.exit(0)\n", "own.py:2: SystemExit: 0"),
        ("import broken\n", "broken.py:2: SyntaxError: "),
    ],
)
def test_a_module_that_cannot_be_imported_says_why_and_where(write, text, said):
    write("broken", "\nx = (\n")
    with pytest.raises(InputError, match=said.replace("(", r"\(")) as caught:
        import_module(write("own", text))
    assert str(caught.value).startswith(said)


def test_a_module_that_is_not_there_is_named(says):
    with says.raises(InputError):
        import_module("nosuchmodule")


def test_a_traceback_is_shown_only_where_it_is_asked_for(write, monkeypatch, capsys):
    write("own", "def plan():\n    1 / 0\n")
    error = raised(importlib.import_module("own").plan)
    show_traceback(error)
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("LME_TRACEBACK", "1")
    show_traceback(error)
    assert "Traceback (most recent call last)" in capsys.readouterr().err
    error.trace = "as elsewhere\n"
    show_traceback(error)
    assert capsys.readouterr().err == "as elsewhere\n"


class Fits:
    """A class whose methods all take an observation and guidance, each in its own way."""

    def __init__(self, config, robot=None, *, other=None): ...

    def plain(self, observation, guidance, scale=1.0): ...

    def any(self, *args, **kwargs): ...

    @classmethod
    def of_class(cls, observation, guidance): ...

    @staticmethod
    def of_none(observation, guidance): ...

    @functools.wraps(explained)
    def decorated(self, *args): ...

    declared = functools.wraps(explained)(lambda self, observation, guidance: None)
    declared.__signature__ = inspect.signature(explained)
    compiled = staticmethod(numba.njit(lambda observation, guidance: observation))
    partial = functools.partial(lambda mine, observation, guidance: None, 1)
    native = staticmethod(max)
    exact = staticmethod(divmod)


class Made:
    def __new__(cls, *args): ...


def test_a_callable_that_takes_the_arguments_is_not_refused():
    for name in (name for name in vars(Fits) if not name.startswith("__")):
        check_call("key", getattr(Fits(None), name), "observation", "guidance")
    for cls in (Fits, Made, dict):
        check_call("key", cls, "config")


@pytest.mark.parametrize(
    "text",
    [
        "def f(observation): ...",
        "def f(observation: int, *, guidance) -> int: ...",
        "def f(observation, guidance, more): ...",
        "class f: ...",
        "class f:\n    def __init__(self, config): ...",
        "class C:\n    def plan(self, o): ...\nf = C().plan",
        "class C:\n    def plan(): ...\nf = C().plan",
        "class C:\n    @staticmethod\n    def plan(o): ...\nf = C.plan",
    ],
)
def test_a_callable_that_takes_other_arguments_is_named_with_both(write, text, says):
    own = importlib.import_module(write("own", text))
    with says.raises(InputError, match="must take"):
        check_call("planner._target_", own.f, "observation", "guidance")
