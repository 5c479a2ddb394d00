"""Episodes, their pages, and a browser that is opened once for each test module."""

import shutil
import time

import pytest

from runners.reports.explainer.write import write_page
from runners.workers.trace import rerun
from tests.composing import jobs_of

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
# First, kept, reached and better are all in it
TRAP = ("map=traps", "robot=turtlebot2", "map.worlds=[1]", "guide.surmount=hidden")


def traced(world, *words):
    """The trace of an episode, of the config that these words come to."""
    with jobs_of() as job:
        return rerun(job(*words).config, world, 0)


@pytest.fixture(scope="package")
def trace():
    return traced(1, *TRAP)


@pytest.fixture(scope="package")
def page_file(trace, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "episode.html"
    write_page(trace, path)
    return path


@pytest.fixture(scope="module")  # not wider: others import it, and two at a time are refused
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"needs a browser: none of {', '.join(BROWSERS)} is on the PATH")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=program, args=ARGUMENTS)
        yield opened
        opened.close()


class Watch:
    """What a page said and asked for that it should not have."""

    def __init__(self, page):
        self.said, self.asked = [], []
        page.on("console", lambda message: self.said.append(message.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.on("request", lambda request: self.asked.append(request.url))

    def strangers(self):
        return [url for url in self.asked if not url.startswith(("file:", "data:", "about:"))]


def opened(browser, path, hash_="", width=1280, height=720, **settings):
    """A file at an address, in a window of its own; its `Watch` at `page.watch`."""
    page = browser.new_context(viewport={"width": width, "height": height}, **settings).new_page()
    page.watch = Watch(page)
    page.goto(f"{path.as_uri()}{hash_}")
    page.wait_for_selector("body.ready", timeout=20000)
    return page


@pytest.fixture
def open_page(browser):
    """Opens a file as `opened` does, until the test is over."""
    pages = []

    def opening(*where, **settings):
        pages.append(opened(browser, *where, **settings))
        return pages[-1]

    yield opening
    for page in pages:
        page.context.close()


@pytest.fixture(scope="module")
def shared(browser, page_file):
    page = opened(browser, page_file)
    yield page
    page.context.close()


@pytest.fixture
def page(shared):
    """The shared window, back at the start."""
    shared.evaluate(
        """() => {
            const { app } = explainer;
            app.playback.pause();
            app.panel.reset();
            app.playback.go(0);
            app.pick(null);
            document.activeElement.blur();
        }"""
    )
    settle(shared)
    yield shared
    assert shared.watch.said == []
    assert shared.watch.strangers() == []


def settle(page):
    """Wait until what was asked for is drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def press(page, *keys):
    """Press keys one after the other, and see what comes of it."""
    for key in keys:
        page.keyboard.press(key)
    settle(page)


def until(page, condition, seconds=30):
    """Wait until a condition of the page holds; Playwright's own way needs the `eval` that the page forbids."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(20)


def step_of(page):
    return page.evaluate("explainer.app.playback.step")
