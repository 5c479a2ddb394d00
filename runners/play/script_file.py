"""The file `play.json` with the changes of a session, beside the record of a drive in a changing world."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.inputs.guarded_file import read_json
from lme.types import Pose
from lme.worlds.world import Task
from runners.play.drawing import Sketch, item_of
from runners.play.session import Script
from runners.records.atomic_write import write_atomically

SCRIPT = "play.json"


def write_script(script: Script, path: Path) -> None:
    """Write the drawings by step, and where the drive begins."""
    drawings = {step: _to_mapping(drawing) for step, drawing in sorted(script.drawings.items())}
    if script.begin is not None:
        drawings[0]["start"] = list(script.begin)
    write_atomically(path, json.dumps({"drawings": drawings}, indent=1) + "\n")


def read_script(path: Path, task: Task) -> Mapping[int, Sketch]:
    """Read the drawings by step, on a task. Raises InputError for a damaged file."""
    try:
        drawings = read_json(path)["drawings"]
        sketches = {int(step): _sketch(task, mapping) for step, mapping in drawings.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: is damaged ({error}): the changes of this drive are lost") from error
    if 0 not in sketches:
        raise InputError(f"{path}: is damaged (no drawing at step 0): the changes of this drive are lost")
    return sketches


def _to_mapping(drawing: Sketch) -> dict[str, Any]:
    items = {name: {"kind": item.kind, "entry": item.entry} for name, item in drawing.items.items()}
    return {
        "start": list(drawing.start),
        "goal": list(drawing.goal),
        "erased": sorted(drawing.erased),
        "items": items,
    }


def _sketch(task: Task, entry: Mapping[str, Any]) -> Sketch:
    x, y = map(float, entry["goal"])
    items = {name: item_of(item["kind"], item["entry"]) for name, item in entry["items"].items()}
    start = Pose(*map(float, entry["start"]))
    return replace(Sketch.of(task), start=start, goal=(x, y), erased=frozenset(entry["erased"]), items=items)
