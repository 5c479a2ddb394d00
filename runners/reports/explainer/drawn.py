"""Candidates and features that the page computes again, instead of reading them from the file.

Random numbers cannot be compressed, and 100 to 300 candidates with their features at every decision are nearly all of a
page. LME and LME+ draw candidates from a generator whose state the page gets (`assets/drawn.js`), and some criteria are
a distance, an angle, or one of the numbers 0 and 1. Python does here what the page will do, and uses it only where the
result is the recorded one to within `QUANTUM`; everything else is written out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme_plus.guide import CANDIDATES, RANGE
from lme.perception.scan_points import is_full_circle
from lme.types import Bools, Floats
from runners.reports.explainer.packer import Packer
from runners.workers.episodes import episode_rng
from runners.workers.trace import Trace

QUANTUM = 1e-9  # [m], [rad], [s]
NONE = np.full(2, np.nan)


class CandidateDraw(NamedTuple):
    """How random candidates are drawn: `number` of them up to `reach` [m], from the bearing `first` over `fov` [rad].

    by_area: equally dense everywhere, instead of at every range. state, inc: of PCG64, as digits of 16 bits, the least
    significant first. These candidates come before all others of a decision.
    """

    number: int
    reach: float
    first: float
    fov: float
    by_area: bool
    state: list[int]
    inc: list[int]

    def placed(self, uniform: Floats) -> Floats:
        """Return the points (N, 2) of uniform numbers (N, 2), as the guide places them."""
        ranges = self.reach * (np.sqrt(uniform[:, 0]) if self.by_area else uniform[:, 0])
        bearings = self.first + self.fov * uniform[:, 1]
        return np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))


def drawn_candidates(trace: Trace, reasons: Sequence[Explanation]) -> CandidateDraw | None:
    """Return how the page draws the random candidates of a trace; None if it cannot."""
    guide_rng = episode_rng(trace.config.seed, trace.world, trace.run).spawn(1)[0].spawn(1)[0]
    drawing = _drawing(trace, reasons[0], guide_rng)
    if drawing is None or len(reasons) != len(trace.steps):
        return None
    for reason in reasons:
        candidates = drawing.placed(guide_rng.random((drawing.number, 2)))
        if not _equal(candidates, reason.candidates[: drawing.number]):
            return None
    return drawing


def add_computed(packer: Packer, reasons: Sequence[Explanation], number: int, v_max: float) -> dict[str, str]:
    """Return by name how the page computes features of the `number` drawn candidates, and add what it needs for that.

    "shown": 0 or 1. "target", "b": minus the distance to that point. "turn": minus the angle to turn. "way": minus the
    time of the straight way there at v_max [m/s]. All but "way" may also be 0, where they do not count.
    """
    candidates = np.concatenate([reason.candidates[:number] for reason in reasons])
    # The values of each kind, were they those of a feature.
    blockages = [reason.view.blockage for reason in reasons]
    points = {
        "target": np.array([reason.view.target for reason in reasons]),
        "b": np.array([NONE if blockage is None else blockage.B for blockage in blockages]),
    }
    kinds = {
        name: -np.hypot(*(candidates - np.repeat(point, number, axis=0)).T) for name, point in points.items()
    }
    kinds["turn"] = -np.abs(np.arctan2(candidates[:, 1], candidates[:, 0]))
    kinds["way"] = -np.hypot(*candidates.T) / v_max
    kinds["shown"] = np.ones(len(candidates))
    computed = {}
    for row, name in enumerate(reasons[0].names):
        feature = np.concatenate([reason.features[row, :number] for reason in reasons])
        counts_here: Bools = feature != 0.0
        for kind, values in kinds.items():
            if _equal(np.where(counts_here, values, 0.0), feature):
                computed[name] = kind
                packer.add_bits(f"counts.{name}", counts_here)
                break
    for kind, point in points.items():
        if kind in computed.values():
            packer.add_doubles(f"exact.{kind}", point)
    return computed


def _drawing(trace: Trace, reason: Explanation, rng: np.random.Generator) -> CandidateDraw | None:
    """Return how LME or LME+ draws its candidates; None for another guide. rng: as at the first decision."""
    guide, scan = trace.config.guide, trace.steps[0].observation.scan
    state = rng.bit_generator.state
    if state["bit_generator"] != "PCG64":
        return None
    digits = _digits(state["state"]["state"]), _digits(state["state"]["inc"])
    if reason.way is not None:
        number = CANDIDATES if guide.get("parts", {}).get("random") else 1
        return CandidateDraw(number, min(RANGE, scan.range_max), -math.pi, 2 * math.pi, False, *digits)
    if "candidates" not in guide:
        return None
    settings = guide["candidates"]
    span = scan.angle_increment * (len(scan.ranges) - (not is_full_circle(scan)))
    first = scan.angle_min + trace.robot.lidar.mount.yaw + min(span, 0.0)
    by_area = settings["distribution"] == "area"
    reach = min(settings["max_range"], scan.range_max)
    return CandidateDraw(
        int(settings["number"]), float(reach), float(first), float(abs(span)), by_area, *digits
    )


def _equal(computed: Floats, recorded: Floats) -> bool:
    return computed.shape == recorded.shape and bool((np.abs(computed - recorded) <= QUANTUM).all())


def _digits(number: int) -> list[int]:
    return [number >> shift & 0xFFFF for shift in range(0, 128, 16)]
