"""How smooth `lme play` is in Chromium: pictures a second while systems drive, and from a drag to its picture.

`python -m benchmarks.play`, with the extra `play`, playwright and Chromium. Both times are taken in the page: a drag
counts until what the robot then sees and decides is drawn.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.command import run_main
from runners.play.message_handler import MessageHandler
from runners.play.run import bound
from runners.play.server import application
from runners.play.session import Session, Source
from runners.play.setups import setup_of

CASES = {
    "an empty room, LME+": (),
    "BARN 282, LME+": ("map=barn", "map.worlds=[282]"),
    "BARN 282, LME and LME+": ("map=barn", "map.worlds=[282]", "system=lme,lme_plus"),
    "a social scene, LME+": ("map=social", "map.kind=doorway", "robot=turtlebot2"),
}
SECONDS, DRAGS = 4.0, 40
WINDOW = {"width": 1600, "height": 900}
ARGUMENTS = ("--no-sandbox", "--disable-gpu")

_PLAY = """async (seconds) => {
  play.go(0);
  play.play(true);
  const [before, begun] = [play.drawn, performance.now()];
  while (performance.now() - begun < 1000 * seconds && play.playing) await new Promise(requestAnimationFrame);
  const rate = (play.drawn - before) / ((performance.now() - begun) / 1000);
  play.play(false);
  return rate;
}"""
_DRAG = """async (count) => {
  const times = [];
  const { x, y } = play.views[0].shownPose;
  const hear = play.connection.hears.message;
  for (let i = 0; i < count; i++) {
    const begun = performance.now();
    let settled = Infinity;
    play.connection.hears.message = (message, arrays) => {
      hear(message, arrays);
      if (message.type === "settled") settled = performance.now();
    };
    play.put("d1", "circles", { centre: [x + 1.5, y + 0.02 * (i - count / 2)], radius: 0.2 }, "drag");
    while (settled === Infinity || play.drawnAt < settled) await new Promise(requestAnimationFrame);
    times.push(play.drawnAt - begun);
    while (play.sending || play.dirty) await new Promise(requestAnimationFrame);
  }
  return times;
}"""


@contextmanager
def _served(words: tuple[str, ...]) -> Iterator[str]:
    """The address of a session's page."""
    import uvicorn

    handler = MessageHandler(Session(setup_of(Source(words))), Path("/tmp"))
    config = uvicorn.Config(
        application(handler, "token"), log_level="error", ws="websockets-sansio", lifespan="off"
    )
    server, listener = uvicorn.Server(config), bound(0)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/token/"
    finally:
        server.should_exit = True
        thread.join()


def _measure(browser: Any, words: tuple[str, ...]) -> tuple[float, list[float]]:
    """Pictures a second, and times from a drag to its picture [ms]."""
    with _served(words) as address:
        page = browser.new_context(viewport=WINDOW).new_page()
        page.goto(address)
        page.wait_for_selector("body.ready")
        page.evaluate("play.forward(3)")  # compiled code is loaded
        rate = page.evaluate(_PLAY, SECONDS)
        page.evaluate("play.go(Math.min(play.last, 25))")
        times = page.evaluate(_DRAG, DRAGS)
        page.context.close()
    return rate, times[1:]


def main() -> None:
    """Print a row for each case."""
    from playwright.sync_api import sync_playwright

    print(f"{'':28}  pictures/s   drag to picture [ms]: median, 90 %, greatest")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=[*ARGUMENTS])
        for name, words in CASES.items():
            rate, times = _measure(browser, words)
            cells = ", ".join(f"{value:.0f}" for value in (*np.percentile(times, [50, 90]), max(times)))
            print(f"{name:28}  {rate:10.0f}   {cells}", flush=True)
        browser.close()


if __name__ == "__main__":
    run_main(main)
