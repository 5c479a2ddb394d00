"""Write the trace of an episode as one HTML file that needs no server, network or other file."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from lme.errors import InputError
from lme.guides.lme.explanation import reason
from runners.config.escaping import html_text
from runners.records.atomic_write import write_atomically
from runners.reports.explainer.encode import encode, title
from runners.workers.trace import Trace

ASSETS = Path(__file__).parent / "assets"
STYLES = ("uplot/uPlot.min.css", "style.css")
SCRIPTS = (  # in this order: each may use those before it
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


def write_page(trace: Trace, path: Path, system: str = "", ending: str = "", play: str = "") -> None:
    """Write the explainer page of an episode. Raises InputError if the file cannot be written.

    system: its name in tables. ending: text after the page. play: argument of `lme play`: "RUN 282/1", or the name of
    a recording beside the page, which finds out its own location; "" for none.
    """
    write_html(path, page(trace, sentences(trace), system, play) + ending)


def write_html(path: Path, text: str) -> None:
    """Write a page or an index, either whole or not at all. Raises InputError if the file cannot be written."""
    try:
        write_atomically(path, text)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}): choose another path") from error


def sentences(trace: Trace) -> list[str]:
    """Return the reason for every decision of LME, as text; an empty list for other guides."""
    reasons = [step.explanation for step in trace.steps]
    pairs = zip([None, *reasons], reasons, strict=False)
    return [reason(explanation, history) for history, explanation in pairs if explanation is not None]


def page(trace: Trace, reasons: Sequence[str], system: str = "", play: str = "") -> str:
    """Return the HTML of the page. reasons: one sentence per decision. system, play: as in `write_page`."""
    style = "\n".join(asset(name) for name in STYLES)
    scripts = "\n".join(asset(name) for name in SCRIPTS)
    script = f'/*\n{asset(LICENCE)}*/\n{asset(LIBRARY)}\n(() => {{\n"use strict";\n{scripts}\n}})();'
    fields = {
        "TITLE": html_text(title(trace)),
        "POLICY": content_security_policy(style, script),
        "STYLE": style,
        "DATA": encode(trace, reasons, system, play),
        "SCRIPT": script,
    }
    return fill("page.html", fields)


def fill(name: str, fields: Mapping[str, str]) -> str:
    """Return an asset in which each NAME in double braces is replaced by its part."""
    return re.sub(r"{{([A-Z]+)}}", lambda match: fields[match[1]], asset(name))


def document_parts(title: str, styles: Sequence[str], scripts: Sequence[str]) -> dict[str, str]:
    """Return HEAD and SCRIPT of a page that shows no episode. title: text. styles, scripts: names of assets."""
    style = "\n".join(map(asset, styles))
    script = '(() => {{\n"use strict";\n{}\n}})();'.format("\n".join(map(asset, scripts)))
    policy = content_security_policy(style, script)
    head = fill("head.html", {"POLICY": policy, "TITLE": html_text(title), "STYLE": style})
    return {"HEAD": head, "SCRIPT": script}


def content_security_policy(style: str, script: str) -> str:
    """Return the content security policy: this style, this script, and no connections."""
    return (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}'"


def asset(name: str) -> str:
    """Return the text of a file that pages are made of."""
    return (ASSETS / name).read_text(encoding="utf-8")
