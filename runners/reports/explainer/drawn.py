"""Candidates and features that the page computes again, instead of reading them from the file.

Random numbers cannot be compressed, and 300 candidates with six features at every decision are nearly all of a page.
LME draws its candidates from a generator whose state the page gets (`assets/drawn.js`), and four of the paper's
criteria are a distance, an angle, or one of the numbers 0 and 1. Python does here what the page will do, and uses it
only where the result is the recorded one to within `QUANTUM`; everything else is written out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.perception.scan_points import is_full_circle
from lme.types import Bools, Floats
from runners.reports.explainer.packer import Packer
from runners.workers.episodes import episode_rng
from runners.workers.trace import Trace

QUANTUM = 1e-9  # [m], [rad]
NONE = np.full(2, np.nan)


class Sector(NamedTuple):
    """Where candidates are drawn: up to `reach` [m], from the bearing `first` over `fov` [rad].

    by_area: equally dense everywhere, instead of at every range.
    """

    reach: float
    first: float
    fov: float
    by_area: bool


def drawn_candidates(trace: Trace, reasons: Sequence[Explanation]) -> dict[str, object] | None:
    """Return how the page draws the candidates of a trace; None if it cannot.

    number: at every decision, before the target itself if that is a candidate. digits: of state and increment of
    PCG64, 16 bits each, the least significant first.
    """
    guide_rng = episode_rng(trace.config.seed, trace.world, trace.run).spawn(1)[0].spawn(1)[0]
    state = guide_rng.bit_generator.state
    settings = trace.config.guide.get("candidates")
    if settings is None or state["bit_generator"] != "PCG64" or len(reasons) != len(trace.steps):
        return None
    number, sector = int(settings["number"]), _sector(trace, settings)
    for step, reason in zip(trace.steps, reasons, strict=True):
        drawn = _placed(guide_rng.random((number, 2)), sector)
        target = np.atleast_2d(step.observation.target)
        expected = np.concatenate([drawn, target[: len(reason.candidates) - number]])
        if not _equal(expected, reason.candidates):
            return None
    digits = {name: _digits(state["state"][name]) for name in ("state", "inc")}
    return {"number": number, **sector._asdict(), **digits}


def add_features(packer: Packer, reasons: Sequence[Explanation]) -> dict[str, str]:
    """Add the features of all candidates, and return how the page computes those that it can by their names.

    "shown": 0 or 1. "target", "b": minus the distance to that point, or 0 where it does not count. "turn": minus
    the angle to turn.
    """
    candidates = np.concatenate([reason.candidates for reason in reasons])
    counts = [len(reason.candidates) for reason in reasons]
    # The values of each kind, were they those of a feature.
    blockages = [reason.view.blockage for reason in reasons]
    points = {
        "target": np.array([reason.view.target for reason in reasons]),
        "b": np.array([NONE if blockage is None else blockage.B for blockage in blockages]),
    }
    kinds = {
        name: -np.hypot(*(candidates - np.repeat(point, counts, axis=0)).T) for name, point in points.items()
    }
    kinds["turn"] = -np.abs(np.arctan2(candidates[:, 1], candidates[:, 0]))
    kinds["shown"] = np.ones(len(candidates))
    for name, point in points.items():
        packer.add_doubles(f"exact.{name}", point)
    computed = {}
    for row, name in enumerate(reasons[0].names):
        feature = np.concatenate([reason.features[row] for reason in reasons])
        counts_here: Bools = feature != 0.0
        for kind, values in kinds.items():
            if _equal(np.where(counts_here, values, 0.0), feature):
                computed[name] = kind
                packer.add_bits(f"counts.{name}", counts_here)
                break
        else:
            packer.add_doubles(f"feature.{name}", feature)
    return computed


def _sector(trace: Trace, settings: dict[str, object]) -> Sector:
    """Return the sector of the guide `lme`, whose bearings are those of the scan."""
    scan, mount = trace.steps[0].observation.scan, trace.robot.lidar.mount
    span = scan.angle_increment * (len(scan.ranges) - (not is_full_circle(scan)))
    reach = min(float(settings["max_range"]), scan.range_max)  # type: ignore[arg-type]
    first = scan.angle_min + mount.yaw + min(span, 0.0)
    return Sector(float(reach), float(first), float(abs(span)), settings["distribution"] == "area")


def _placed(uniform: Floats, sector: Sector) -> Floats:
    """Return the points (N, 2) of uniform numbers (N, 2), as the guide places them."""
    ranges = sector.reach * (np.sqrt(uniform[:, 0]) if sector.by_area else uniform[:, 0])
    bearings = sector.first + sector.fov * uniform[:, 1]
    return np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))


def _equal(computed: Floats, recorded: Floats) -> bool:
    return computed.shape == recorded.shape and bool((np.abs(computed - recorded) <= QUANTUM).all())


def _digits(number: int) -> list[int]:
    return [number >> shift & 0xFFFF for shift in range(0, 128, 16)]
