"""What holds for every test: `says`, marks `browser` and `ros`, `--last-skipped`, kernels that are compiled once."""

import contextlib
import gc
import re
import sys

import pytest
from hypothesis import HealthCheck, settings

from lme.errors import InputError
from tests.places import ROOT

# No test fails for being slow: the machine may be busy, and the first call compiles.
_usual = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("usual", _usual, max_examples=30)
settings.register_profile("thorough", _usual, max_examples=300)  # --hypothesis-profile=thorough
settings.load_profile("usual")

_MARKED_BY_FIXTURE = {"browser", "ros"}
_CACHE_KEY = "lme/skipped"
_MANY = 2000  # tests, which call most kernels
_skipped: set[str] = set()

# Ten thousand tests with their configs are many objects that stay, and looking through them takes a tenth of the time.
gc.set_threshold(20_000, 50, 100)


@pytest.fixture(autouse=True, scope="session")
def own_runs(tmp_path_factory):
    """The key by which a user's own runs are known is not that of the user who tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture
def no_own_weights(tmp_path, monkeypatch):
    """The weights that a developer has trained in this checkout are not known."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(autouse=True, scope="session")
def compiled(request, tmp_path_factory):
    """The kernels, before the tests of a worker of pytest-xdist that has many of them."""
    if hasattr(request.config, "workerinput") and len(request.session.items) > _MANY:
        from tests.compiling import compile_together

        compile_together(tmp_path_factory.getbasetemp().parent)


@pytest.fixture(scope="module")
def undrawn():
    """Make pictures without drawing them, for tests of what else a command does; tests/runners/reports/ draws each."""

    def write(figure, file, **given):
        file.write(b"not drawn")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", write)
        yield


OPTIONS = {  # a new one changes no wording
    ", ".join(names): f"<conf/{folder.relative_to(ROOT / 'conf')}>"
    for folder in sorted((ROOT / "conf").rglob("*/"))
    if len(names := sorted(file.stem for file in folder.glob("[!_]*.yaml"))) > 3
}


class Says:
    """Compare messages with their wording in `__snapshots__`, where what varies by itself has a name or is rounded."""

    def __init__(self, snapshot, folders):
        self._snapshot = snapshot
        self._names = {**folders, **OPTIONS}

    def __call__(self, message):
        __tracebackhide__ = True
        text = str(message).rstrip("\n")
        for old, new in self._names.items():
            text = text.replace(str(old), new)
        text = re.sub(r"BASE/([^/\d]+)\d+", r"BASE/\1", text)
        text = re.sub(r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d-\w{8}", "RUN", text)
        text = re.sub(r"0x[0-9a-f]{6,}", "0x...", text)
        text = re.sub(r"\d+\.\d{7,}", lambda digits: f"{float(digits[0]):.6g}", text)
        assert text == self._snapshot

    @contextlib.contextmanager
    def raises(self, kind, match=None):
        """Expect an exception and its wording. `match` is for what must stay in it, such as a key and its value."""
        with pytest.raises(kind, match=match) as error:
            yield error
        assert kind is not InputError or "\n" not in str(error.value)
        self(error.value)

    @contextlib.contextmanager
    def warns(self, match=None):
        """Expect warnings and their wording; one that comes again counts once."""
        with pytest.warns(UserWarning, match=match) as caught:
            yield caught
        texts = [str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)]
        self("\n".join(dict.fromkeys(texts)))


@pytest.fixture
def says(snapshot, tmp_path, tmp_path_factory):
    base = tmp_path_factory.getbasetemp()
    return Says(snapshot, {tmp_path: "TMP", base: "BASE", ROOT: "CHECKOUT", sys.prefix: "PYTHON"})


def pytest_addoption(parser):
    parser.addoption(
        "--last-skipped",
        action="store_true",
        help="run only the tests that the last run skipped, as after an installation of torch or ROS",
    )


@pytest.hookimpl(tryfirst=True)  # -m selects by the marks
def pytest_collection_modifyitems(config, items):
    for item in items:
        for name in _MARKED_BY_FIXTURE.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(name)
    if config.getoption("last_skipped"):
        if getattr(config, "cache", None) is None:
            raise pytest.UsageError("--last-skipped reads pytest's cache: leave out -p no:cacheprovider")
        skipped = set(config.cache.get(_CACHE_KEY, []))
        chosen = [item for item in items if not skipped.isdisjoint((item.nodeid, item.nodeid.split("::")[0]))]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


def pytest_collectreport(report):
    _note(report)  # a whole module


def pytest_runtest_logreport(report):
    _note(report)


def pytest_sessionfinish(session, exitstatus):
    config = session.config
    if config.getoption("last_skipped") and exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
        session.exitstatus = pytest.ExitCode.OK  # nothing was skipped
    if not hasattr(config, "workerinput") and getattr(config, "cache", None):  # not a worker of pytest-xdist
        config.cache.set(_CACHE_KEY, sorted(_skipped))


def _note(report: pytest.CollectReport | pytest.TestReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        _skipped.add(report.nodeid)
