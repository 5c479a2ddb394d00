"""The input of a figure: the runs of a sweep, or a single run, and one moment of a run with its decision."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, astuple, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from lme.config.presets import load_settings
from lme.errors import InputError, require
from lme.guides.lme.explanation import Explanation, reason
from lme.guides.lme.guide import Lme
from lme.guides.lme.maintenance import Choice
from lme.worlds.world import MapSet
from runners.config import build
from runners.config.instantiate import configured
from runners.config.schema import RecordedConfig, SystemConfig
from runners.records import launch_record
from runners.records.episode_record import KEY_COLUMNS, EpisodeKey
from runners.records.launch_record import Launch
from runners.records.records import find_runs, read_episodes, read_trajectories
from runners.reports.analysis.summary import ablated
from runners.reports.figures.style import entitle, save
from runners.workers.trace import Trace, rerun_recorded, step_tables

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(slots=True)
class StepConfig:
    """The decision that a figure shows."""

    step: int | None

    def __post_init__(self) -> None:
        if self.step is not None:
            require("step", self.step, at_least=0)


class DecisionView(NamedTuple):
    """One decision of an episode. label: of the system. why: explains the decision."""

    label: str
    trace: Trace
    step: int
    why: Explanation

    @property
    def before(self) -> Explanation | None:
        """The previous decision; None at the first step."""
        return None if self.step == 0 else self.trace.steps[self.step - 1].explanation

    @property
    def history_length(self) -> int:
        """k, the number of remembered positions."""
        return int(_guide(self.trace.config).history_length)


def telling_step(trace: Trace) -> int:
    """Return the step of the most telling decision: the first with the most of these properties.

    A sector blocks the way to the target; both its ends and B are within the candidates' range; a better subgoal
    replaces the old one; it gains by c_t; it gains by a_mount; recent positions count.
    """
    reach = candidate_reach(trace)
    signs = [0 if step.explanation is None else sum(_signs(step.explanation, reach)) for step in trace.steps]
    return signs.index(max(signs))


class Guided(NamedTuple):
    """The guide whose decisions a figure shows. option: in `conf/guide/`. telling: finds the most telling step."""

    cls: type
    label: str
    option: str
    telling: Callable[[Trace], int]


LME = Guided(Lme, "LME", "lme", telling_step)


def shots(
    runs: Sequence[DrivenRun], worlds: Sequence[int], step: int | None, figure: str, guided_by: Guided = LME
) -> list[DecisionView]:
    """Return the decision to draw for every run and world. Runs with another guide are skipped.

    step: of the decision; None: the most telling one. figure: name of the kind, for messages. Raises InputError if no
    run is left, or if an episode has no such step.
    """
    check_guided([driven_run.config for driven_run in runs], figure, guided_by)
    guided = [driven_run for driven_run in runs if _is_guided(driven_run.config, guided_by)]
    world_choices: list[list[int]] = [[world] for world in worlds] or [[]]
    return [_shot(driven_run, world, step, guided_by) for driven_run in guided for world in world_choices]


def check_guided(configs: Sequence[SystemConfig], figure: str, guided_by: Guided) -> None:
    """Raise InputError if none of the systems has this guide. figure: name of the kind."""
    if not any(_is_guided(config, guided_by) for config in configs):
        guides = ", ".join(sorted(set(map(_target, configs))))
        raise InputError(
            f"guide is {guides}: {figure} draws how {guided_by.label} scores candidates; "
            f"choose guide={guided_by.option}, or a run of {guided_by.label}"
        )


def candidate_reach(trace: Trace) -> float:
    """Return the largest distance of a candidate from the robot [m]; LME's default for LME+, which has no setting."""
    candidates = getattr(_guide(trace.config), "candidates", load_settings("guide/lme").candidates)
    return float(min(candidates.max_range, trace.robot.lidar.range_max))


def heading(shot: DecisionView) -> tuple[str, str]:
    """Return the title, which is the place and time, and the decision as a sentence below it."""
    trace = shot.trace
    episode = f"{shot.label} · {trace.task.map_name}, world {trace.world}, run {trace.run}"
    moment = f"step {shot.step} of 0–{len(trace.steps) - 1}, {trace.steps[shot.step].time:.1f} s"
    words = reason(shot.why, shot.before)
    return f"{episode} · {moment}", words[0].upper() + words[1:]


class DecisionFigure:
    """A `Kind` of figure with one picture for each decision, which a subclass draws in `figure`."""

    name: str
    drives = True
    guided: Guided | None = LME

    def __init__(self, config: Any) -> None:
        """Prepare the figure. config: a `StepConfig`."""
        self._config = config

    def figure(self, shot: DecisionView) -> Figure:
        """Draw the page of one decision."""
        raise NotImplementedError

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Save one picture per run with this guide and per requested world, numbered from 1 if there are several."""
        assert self.guided is not None
        decisions = shots(runs, worlds, self._config.step, self.name, self.guided)
        numbered_stems = [stem.with_name(f"{stem.name}_{number}") for number in range(1, len(decisions) + 1)]
        stems = numbered_stems if len(decisions) > 1 else [stem]
        paths = []
        for decision, path_stem in zip(decisions, stems, strict=True):
            figure, (title, subtitle) = self.figure(decision), heading(decision)
            entitle(figure, title, subtitle=subtitle)
            paths += save(figure, path_stem, formats)
        return paths


def _shot(driven_run: DrivenRun, worlds: Sequence[int], step: int | None, guided_by: Guided) -> DecisionView:
    world, run = chosen_world(driven_run, worlds)
    trace = driven_run.trace(world, run)
    number = guided_by.telling(trace) if step is None else step
    if number >= len(trace.steps):
        raise InputError(
            f"figure.step is {number}: world {world}, run {run} of {driven_run.label} has the steps "
            f"0 to {len(trace.steps) - 1}"
        )
    explanation = trace.steps[number].explanation
    if explanation is None:
        raise InputError(
            f"figure.step is {number}: {_target(driven_run.config)} did not ask {guided_by.label} for a subgoal then"
        )
    return DecisionView(driven_run.label, trace, number, explanation)


def _signs(explanation: Explanation, reach: float) -> list[bool]:
    """Return for each property that `telling_step` counts whether a decision has it."""
    blockage = explanation.view.blockage
    ends = () if blockage is None else (blockage.E1, blockage.E2, blockage.B)
    return [
        blockage is not None,
        blockage is not None and all(math.hypot(*end) <= reach for end in ends),
        explanation.decision.choice is Choice.BETTER,
        _gain(explanation, "c_t") > 0,
        _gain(explanation, "a_mount") > 0,
        len(explanation.view.history) > 0,
    ]


def _gain(explanation: Explanation, name: str) -> float:
    """Return by how much the best candidate exceeds the old subgoal in a criterion; 0 without an old subgoal."""
    if explanation.old_features is None:
        return 0.0
    row = explanation.names.index(name)
    return float(explanation.features[row, explanation.new] - explanation.old_features[row])


def _is_guided(config: SystemConfig, guided_by: Guided) -> bool:
    cls, _ = configured(config.guide, "guide")
    return isinstance(cls, type) and issubclass(cls, guided_by.cls)


def _guide(config: SystemConfig) -> Any:
    """Return the checked config of LME."""
    return configured(config.guide, "guide")[1]


def _target(config: SystemConfig) -> str:
    return str(config.guide["_target_"])


class DrivenRun:
    """One run. frame: its records, one row per episode. worlds_config: its config without the system.

    place: the map's config and the robot's footprint as JSON, equal for runs that share a place.
    """

    def __init__(self, run_dir: Path, launch: Launch, frame: pd.DataFrame) -> None:
        self.run_dir = run_dir
        self.frame = frame
        self._launch = launch
        self.worlds_config = launch.worlds_config
        self.place = json.dumps(
            [self.worlds_config.map, asdict(self.worlds_config.robot.footprint)], sort_keys=True
        )

    @cached_property
    def config(self) -> RecordedConfig:
        """The config of the run. Raises UntrustedError if it names code that may not be executed."""
        return self._launch.config

    @property
    def label(self) -> str:
        """The name of the system, with its ablation and scale where it has them."""
        episode = self.frame.iloc[0]
        name = " ".join(filter(None, (str(episode["system"]), ablated(self.frame))))
        scale = str(episode.get("scale", ""))
        return f"{name}, {scale}" if scale else name

    @cached_property
    def maps(self) -> MapSet:
        """The map set of the run."""
        return build.map_set(self.worlds_config, sorted({int(world) for world in self.frame["world"]}))

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row per recorded control step of all episodes."""
        return read_trajectories([self.run_dir])

    def steps(self, worlds: Collection[int]) -> pd.DataFrame:
        """Return one row per control step in these worlds. Episodes without steps are driven again, once.

        Raises InputError if that is not possible.
        """
        import pandas as pd

        # Episodes whose steps were not recorded, or deleted, are driven again.
        stored = {*map(tuple, self.trajectories[list(KEY_COLUMNS)].drop_duplicates().to_numpy().tolist())}
        rows = self.frame[self.frame["world"].isin(worlds)].to_dict("records")
        unstored = {key: row for row in rows if astuple(key := EpisodeKey.of(row)) not in stored}
        if unstored:
            rerun_tables = (table.to_pandas() for table in step_tables(self.run_dir, unstored))
            self.trajectories = pd.concat([*([self.trajectories] if stored else []), *rerun_tables])
        return self.trajectories[self.trajectories["world"].isin(worlds)]

    def trace(self, world: int, run: int) -> Trace:
        """Drive an episode again and return its trace. Raises InputError if that is not possible."""
        return rerun_recorded(self.run_dir, world, run, self.trajectories)


class Kind(Protocol):
    """A kind of figure: one file in `runners/reports/figures/` and one YAML in `conf/figure/`.

    name: stem of its files. drives: whether it needs episodes. guided: the guide whose decisions it draws; None if it
    draws any system.
    """

    name: str
    drives: bool
    guided: Guided | None

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the runs, save the figure as `stem`.png, …, and return the paths. worlds: as requested, may be empty."""


def read_runs(paths: Sequence[Path]) -> list[DrivenRun]:
    """Return the runs below these paths of runs and sweeps, in order.

    Raises InputError for a path without records.
    """
    run_dirs = find_runs(paths)
    frame = read_episodes(run_dirs)
    return runs_of(frame, run_dirs)


def runs_of(frame: pd.DataFrame, run_dirs: Sequence[Path]) -> list[DrivenRun]:
    """Return the runs of records that are already read. A folder without a launch record is skipped."""
    launches = [(run_dir, launch_record.read_launch(run_dir)) for run_dir in run_dirs]
    records = {run_dir: frame[frame["run_dir"] == str(run_dir)] for run_dir in run_dirs}
    return [
        DrivenRun(run_dir, launch, records[run_dir])
        for run_dir, launch in launches
        if launch is not None and not records[run_dir].empty
    ]


def chosen_world(source: DrivenRun, worlds: Sequence[int]) -> tuple[int, int]:
    """Return (world, run number) of the episode to draw, in the first of `worlds`, or the first of all without any.

    Raises InputError if the run has no episode in that world.
    """
    keys = sorted(zip(source.frame["world"].astype(int), source.frame["run"].astype(int), strict=True))
    candidates = [key for key in keys if not worlds or key[0] == worlds[0]]
    if not candidates:
        numbers = sorted({world for world, _ in keys})
        listing = ", ".join(map(str, numbers[:12])) + (", …" if len(numbers) > 12 else "")
        raise InputError(f"world is {worlds[0]}: {source.run_dir} has only {listing}")
    return candidates[0]
