"""An episode told again, as one HTML file: no server, no network, nothing beside it."""

from __future__ import annotations

import base64
import hashlib
import html
from collections.abc import Sequence
from pathlib import Path

from lme.errors import InputError
from lme.policy.reasons import reason
from runners.page.encode import encode, title
from runners.retell import Tale

ASSETS = Path(__file__).parent / "assets"
STYLES = ("uplot/uPlot.min.css", "style.css")
SCRIPTS = (  # in this order: each may use those before it
    "data.js",
    "score.js",
    "colours.js",
    "theme.js",
    "format.js",
    "camera.js",
    "marks.js",
    "ground.js",
    "scene.js",
    "pointer.js",
    "bars.js",
    "timeline.js",
    "parameters.js",
    "legend.js",
    "words.js",
    "playback.js",
    "keyboard.js",
    "main.js",
)
LIBRARY, LICENCE = "uplot/uPlot.iife.min.js", "uplot/LICENSE"


def write_page(tale: Tale, path: Path) -> None:
    """Write the explainer page of an episode. Raises InputError where the file cannot be written."""
    try:
        path.write_text(page(tale, sentences(tale)), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}): choose another place") from error


def sentences(tale: Tale) -> list[str]:
    """Why LME went on or switched, at every decision; none for other guides."""
    reasons = [moment.explanation for moment in tale.moments]
    pairs = zip([None, *reasons], reasons, strict=False)
    return [reason(now, before) for before, now in pairs if now is not None]


def page(tale: Tale, told: Sequence[str]) -> str:
    """The whole file. told: a sentence for each decision."""
    style = "\n".join(_asset(name) for name in STYLES)
    own = "\n".join(_asset(name) for name in SCRIPTS)
    script = f'/*\n{_asset(LICENCE)}*/\n{_asset(LIBRARY)}\n(() => {{\n"use strict";\n{own}\n}})();'
    parts = {
        "TITLE": html.escape(title(tale)),
        "POLICY": _policy(style, script),
        "STYLE": style,
        "DATA": encode(tale, told),
        "SCRIPT": script,
    }
    text = _asset("page.html")
    for name, part in parts.items():
        text = text.replace(f"{{{{{name}}}}}", part, 1)
    return text


def _policy(style: str, script: str) -> str:
    """Content security: this style, this script, and no connection to anywhere."""
    return (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}'"


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")
