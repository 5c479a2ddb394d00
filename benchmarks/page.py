"""Measures the size of explainer pages of a drive of 90 s at 20 Hz, and the speed of scrubbing.

    python -m benchmarks.page [--record]

Advances one step per frame in headless Chromium without a graphics card. Needs playwright and a browser. --record also
writes benchmarks/results/page.md.
"""

import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from runners.config.command_line import compose
from runners.reports.explainer.write import write_page
from runners.workers.trace import Trace, rerun

WANTED_PER_S, WANTED_MB = 30, 3.0
DRIVE = ("map=barn", "sim=fast", "map.worlds=[250]", "robot.control_rate=20", "robot.v_max=0.1")  # 90 s
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SIZES = {"desktop": (1440, 900, 1), "phone": (390, 844, 3)}
SCRUB = """(settings) => new Promise((done) => {
    const { app, trace } = explainer;
    for (const [id, value] of Object.entries(settings)) {
        if (document.getElementById(id).checked !== value) app.click(id);
    }
    const times = [];
    const tick = (now) => {
        times.push(now);
        if (times.length > trace.last) done(times.slice(1).map((time, i) => time - times[i]));
        else { app.playback.go(times.length); requestAnimationFrame(tick); }
    };
    app.playback.go(0);
    requestAnimationFrame(tick);
})"""
JUDGE = """() => {
    const { app } = explainer;
    const begin = performance.now();
    for (let i = 0; i < 50; i++) app.panel.set({ c_t: 100 + i });
    return (performance.now() - begin) / 50;
}"""


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "page", parser(__doc__, "page").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    from playwright.sync_api import sync_playwright

    yield "# Explainer page\n"
    yield f"`python -m benchmarks.page --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"Wanted: {WANTED_PER_S} steps per second while scrubbing, less than {WANTED_MB:g} MB.\n"
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        path = Path(folder) / "page.html"
        for system in ("lme_plus", "lme"):
            trace = _episode(f"system={system}")
            write_page(trace, path)
            candidates = sum(len(m.explanation.scores) for m in trace.steps if m.explanation) / len(
                trace.steps
            )
            megabytes = path.stat().st_size / 1e6
            counts = f"{len(trace.steps)} steps, {candidates:.0f} candidates each"
            yield f"`system={system}`: {counts}: {megabytes:.2f} MB.\n"
        yield "The frames are those of `system=lme`.\n"
        browser = driver.chromium.launch(executable_path=_program(), args=ARGUMENTS)
        yield "| window | view | steps/s | frame p50 [ms] | p99 [ms] | all steps decided again [ms] |"
        yield "|---|---|---:|---:|---:|---:|"
        for name, size in SIZES.items():
            yield from _rows(browser, path, name, *size)
        browser.close()


def _rows(browser: Any, path: Path, name: str, width: int, height: int, ratio: int) -> Iterator[str]:
    context = browser.new_context(viewport={"width": width, "height": height}, device_scale_factor=ratio)
    page = context.new_page()
    page.goto(path.as_uri())
    page.wait_for_selector("body.ready")
    judged = page.evaluate(JUDGE)
    for view, settings in {
        "map": {"follow": False, "truth": False},
        "heading up, true map": {"follow": True, "truth": True},
    }.items():
        page.evaluate(SCRUB, settings)  # a first pass compiles the page's code and is not measured
        frames = page.evaluate(SCRUB, settings)
        cuts = statistics.quantiles(frames, n=100)
        rate = 1000 / statistics.mean(frames)
        cells = f"{rate:.0f} | {statistics.median(frames):.1f} | {cuts[98]:.1f} | {judged:.1f}"
        yield f"| {name} {width} × {height}, {ratio}× | {view} | {cells} |"
    context.close()


def _episode(system: str) -> Trace:
    (job,) = compose("eval", [system, *DRIVE])
    return rerun(job.config, 250, 0)


def _program() -> str:
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise SystemExit(f"needs a browser: none of {', '.join(BROWSERS)} is on the PATH")
    return program


if __name__ == "__main__":
    run_main(main)
