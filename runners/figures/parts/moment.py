"""One decision of LME, chosen to be looked at, and its heading."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.errors import InputError
from lme.guides.lme import Lme
from lme.policy.explanation import Explanation
from lme.policy.maintenance import Choice
from lme.policy.reasons import reason
from runners.config.instantiate import configured
from runners.config.schema import SystemConfig
from runners.figures.parts.driven_runs import DrivenRun, chosen_world
from runners.figures.parts.style import INK, save
from runners.workers.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE_IN, LINE_LETTERS = 0.145, 112  # of a heading on a page of 7 in


class Shot(NamedTuple):
    """One decision of an episode. label: the system's. why: the decision, explained."""

    label: str
    trace: Trace
    step: int
    why: Explanation

    @property
    def before(self) -> Explanation | None:
        """The decision before."""
        return None if self.step == 0 else self.trace.steps[self.step - 1].explanation

    @property
    def history_length(self) -> int:
        """k, how many positions are remembered."""
        return int(_guide(self.trace.config).history_length)


def shots(jobs: Sequence[DrivenRun], worlds: Sequence[int], step: int | None, figure: str) -> list[Shot]:
    """The decision to draw of every job and world; jobs of a sweep that LME does not guide are left out.

    step: its number, None for the most telling. figure: the kind's name, for messages. Raises InputError where
    LME guides none of the jobs, or an episode has no such step.
    """
    guided = [job for job in jobs if _is_guided(job)]
    if not guided:
        guides = ", ".join(sorted({_target(job.config) for job in jobs}))
        raise InputError(
            f"guide is {guides}: {figure} draws how LME scores candidates; choose guide=lme, or a run of LME"
        )
    asked: list[list[int]] = [[world] for world in worlds] or [[]]
    return [_shot(job, world, step) for job in guided for world in asked]


def telling_step(trace: Trace) -> int:
    """The most telling decision of an episode: the first for which most of these hold.

    A sector blocks the way to the target; both its ends, and B, are within the candidates' range; the subgoal is left
    for a better one; which gains by c_t; and by a_mount; recent positions count.
    """
    reach = candidate_reach(trace)
    held = [0 if step.explanation is None else sum(_signs(step.explanation, reach)) for step in trace.steps]
    return held.index(max(held))


def candidate_reach(trace: Trace) -> float:
    """Candidates lie within this range of the robot [m]."""
    return float(min(_guide(trace.config).candidates.max_range, trace.robot.lidar.range_max))


def heading(shot: Shot) -> list[str]:
    """Where and when, then the decision in words, in lines that fit on a page's width."""
    trace = shot.trace
    where = f"{shot.label} · {trace.task.map_name}, world {trace.world}, run {trace.run}"
    when = f"step {shot.step} of 0–{len(trace.steps) - 1}, {trace.steps[shot.step].time:.1f} s"
    words = reason(shot.why, shot.before)
    return [f"{where} · {when}", *textwrap.wrap(words[0].upper() + words[1:], LINE_LETTERS)]


def heading_height(lines: Sequence[str]) -> float:
    """What a heading takes at the top of a page [in]."""
    return 0.08 + LINE_IN * len(lines)


def draw_heading(figure: Figure, lines: Sequence[str]) -> None:
    """The first line in bold, at the top left."""
    for number, line in enumerate(lines):
        look: dict[str, Any] = {"fontsize": 8} if number else {"fontsize": 8.5, "fontweight": "bold"}
        x, y = 0.08 / figure.get_figwidth(), 1 - (0.05 + number * LINE_IN) / figure.get_figheight()
        figure.text(x, y, line, va="top", color=INK, **look)


def draw_shots(
    found: Sequence[Shot], figure_of: Callable[[Shot], Figure], stem: Path, formats: Sequence[str]
) -> list[Path]:
    """One picture of each moment, numbered from 1 where there are several; the paths."""
    numbered = [stem.with_name(f"{stem.name}_{number}") for number in range(1, len(found) + 1)]
    places = numbered if len(found) > 1 else [stem]
    return [
        path for shot, to in zip(found, places, strict=True) for path in save(figure_of(shot), to, formats)
    ]


def _shot(job: DrivenRun, worlds: Sequence[int], step: int | None) -> Shot:
    world, run = chosen_world(job, worlds)
    trace = job.trace(world, run)
    number = telling_step(trace) if step is None else step
    if number >= len(trace.steps):
        raise InputError(
            f"figure.step is {number}: world {world}, run {run} of {job.label} has the steps "
            f"0 to {len(trace.steps) - 1}"
        )
    why = trace.steps[number].explanation
    if why is None:
        raise InputError(f"figure.step is {number}: {_target(job.config)} did not ask LME for a subgoal then")
    return Shot(job.label, trace, number, why)


def _signs(why: Explanation, reach: float) -> list[bool]:
    """What makes a decision telling, see `telling_step`."""
    blockage = why.view.blockage
    ends = () if blockage is None else (blockage.E1, blockage.E2, blockage.B)
    return [
        blockage is not None,
        blockage is not None and all(math.hypot(*end) <= reach for end in ends),
        why.decision.choice is Choice.BETTER,
        _gain(why, "c_t") > 0,
        _gain(why, "a_mount") > 0,
        len(why.view.history) > 0,
    ]


def _gain(why: Explanation, name: str) -> float:
    """What the best candidate has over the old subgoal by one criterion."""
    if why.old_features is None:
        return 0.0
    row = why.names.index(name)
    return float(why.features[row, why.new] - why.old_features[row])


def _is_guided(job: DrivenRun) -> bool:
    cls, _ = configured(job.config.guide, "guide")
    return isinstance(cls, type) and issubclass(cls, Lme)


def _guide(config: SystemConfig) -> Any:
    """The checked config of LME."""
    return configured(config.guide, "guide")[1]


def _target(config: SystemConfig) -> str:
    return str(config.guide["_target_"])
