"""The data that the page shows besides frames: the state of the session, and the options to choose from."""

from __future__ import annotations

from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from runners.config import catalogue, systems
from runners.play.frames import head
from runners.play.session import Session, Setup

GROUPS = ("robot", "map", "sim", "crowd", "ablation")
SIM_KEYS = (
    "latency",
    "lag",
    "slip",
    "odometry_error",
    "scan_noise",
    "scan_dropout",
    "goal_noise",
    "goal_noise_yaw",
)
ROBOT_KEYS = ("v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate")
LIDAR_KEYS = ("num_beams", "fov", "range_max", "noise_std")
_MOST_NUMBERS = 5000  # most worlds that are listed


def situation(session: Session, num_kept: int) -> dict[str, Any]:
    """Return the session's state after a change. num_kept: number of frames that the page may keep."""
    setup = session.script.setup
    return {
        "type": "situation",
        "revision": session.revision,
        "kept": num_kept,
        "step": session.shown,
        "lanes": [head(lane) for lane in session.lanes],
        "words": list(setup.source.words) if setup.source else [],
        "map": setup.task.map_name,
        "world": setup.task.number,
        "worlds": list(setup.numbers[:_MOST_NUMBERS]),
        "run": setup.run,
        "seed": setup.seed,
        "values": _values(setup),
        "undoable": session.undoable,
        "redoable": session.redoable,
    }


def options(folders: tuple[Path, ...], maps: list[str]) -> dict[str, Any]:
    """Return all options by name, with what they are. maps: files of maps that can be opened."""
    return {"type": "options", "files": maps, **_named_options(folders)}


@cache
def _named_options(folders: tuple[Path, ...]) -> dict[str, Any]:
    configs = catalogue.Catalogue(folders)
    groups: dict[str, Any] = {group: configs.titles(group) for group in GROUPS}
    groups["map"].pop("file", None)  # it needs a path, which `files` give
    groups["system"] = {name: system.label for name, system in systems.systems(folders).items()}
    groups["weights"] = {name: configs.title(f"weight_set/{name}") for name in configs.options("weight_set")}
    return groups


def _values(setup: Setup) -> dict[str, Any]:
    """Return the numbers that can be set, by key, with their present values in the first system."""
    config = setup.systems[0].config
    robot, lidar = config.robot, asdict(config.robot.lidar)
    values = {f"robot.{key}": getattr(robot, key) for key in ROBOT_KEYS}
    values |= {f"robot.lidar.{key}": lidar[key] for key in LIDAR_KEYS}
    return values | {f"sim.{key}": config.sim[key] for key in SIM_KEYS if key in config.sim}
