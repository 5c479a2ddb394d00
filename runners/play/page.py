"""The page and its scripts. Scene, colours and scores are those of the explainer page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from runners.reports.explainer.write import asset

ASSETS = Path(__file__).parent / "assets"
SHARED = (  # of the explainer page, in this order: each may use those before it
    "data.js",
    "score.js",
    "colours.js",
    "theme.js",
    "format.js",
    "meanings.js",
    "camera.js",
    "marks.js",
    "ground.js",
    "scene.js",
    "bars.js",
    "legend.js",
    "words.js",
)
OWN = (
    "live.js",
    "connection.js",
    "shapes.js",
    "tools.js",
    "layers.js",
    "settings.js",
    "selection.js",
    "results.js",
    "thoughts.js",
    "lane.js",
    "keys.js",
    "main.js",
)
POLICY: Final = (
    "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


def script() -> str:
    """Return all scripts as one, so that the shared ones need not be modules."""
    sources = [*map(asset, SHARED), *map(own, OWN)]
    return '(() => {{\n"use strict";\n{}\n}})();'.format("\n".join(sources))


def style() -> str:
    """Return the style of the explainer page, followed by what differs here."""
    return asset("style.css") + own("play.css")


def own(name: str) -> str:
    """Return the text of an asset."""
    return (ASSETS / name).read_text(encoding="utf-8")


PARTS: Final[dict[str, tuple[str, Callable[[], str]]]] = {  # by name: type, and how it is made
    "": ("text/html", lambda: own("play.html")),
    "play.js": ("text/javascript", script),
    "play.css": ("text/css", style),
}
