"""Details of a decision beyond those in every frame, recomputed on a copy of the drive."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from lme.guides.lme_plus.guide import LmePlus
from lme.planners.commands import Weighing
from lme.planners.safety.filter import SafetyFilter
from runners.play.simulation_track import SimulationTrack, Tasks
from runners.reports.explainer.packer import Packer
from runners.workers.trace import TracedStep

LAYERS = ("memory", "times", "arcs")


def detail_message(
    lane: SimulationTrack, step: int, tasks: Tasks, layers: Collection[str], header_fields: dict[str, Any]
) -> bytes:
    """Return those of the requested layers that the decision has.

    memory: obstacle points that the guide knows, in the robot frame. times: expected times on a grid, in the frame in
    which `pose` is the pose of the robot. arcs: commands that the planner tried, with their costs.
    """
    packer, header = Packer(), dict(header_fields)
    frame = lane.frames[min(step, len(lane.frames) - 1)]
    moment = frame.moment
    if isinstance(moment, TracedStep):
        if "memory" in layers and moment.guidance.points is not None:
            packer.add_singles("memory", moment.guidance.points)
        if {"times", "arcs"} & {*layers}:
            header |= _explanation_fields(packer, lane, step, tasks, layers, moment)
    return packer.raw(header)


def _explanation_fields(
    packer: Packer,
    lane: SimulationTrack,
    step: int,
    tasks: Tasks,
    layers: Collection[str],
    moment: TracedStep,
) -> dict[str, Any]:
    """Add what the guide and the planner computed to the packer, and return the entries of the header."""
    # Work on a copy of the episode, so that the drive itself stays as it is.
    episode = lane.before(step, tasks)
    if episode is None:
        return {}
    header: dict[str, Any] = {}
    guide, planner = episode.navigator.guide, episode.navigator.planner
    planner = planner.planner if isinstance(planner, SafetyFilter) else planner
    if "arcs" in layers and isinstance(planner, Weighing):
        weighed = planner.weighed(moment.observation, moment.guidance)
        packer.add_singles("arcs", weighed.commands)
        packer.add_singles("costs", weighed.costs)
        header["horizon"] = weighed.horizon
    if "times" in layers and isinstance(guide, LmePlus):
        episode.decide()
        sight = guide.sight
        assert sight is not None
        field = sight.field
        inner = field.times[1:-1, 1:-1]  # without the border of one cell
        packer.add_singles("times", np.where(np.isfinite(inner), inner, np.nan))
        header["grid"] = [field.grid.x, field.grid.y, field.grid.cell, field.grid.size]
        header["pose"] = list(sight.pose)
    return header
