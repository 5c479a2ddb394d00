"""Comparison of runs with one of them, by world and run, in the worlds that both drove.

The statistics are those of `runners.reports.analysis.paired`. The first run is the reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from runners.config.escaping import counted, visible
from runners.records.episode_record import COLUMNS, KEY_COLUMNS, TEXTS
from runners.records.launch_record import Launch, read_launch
from runners.reports.analysis import paired
from runners.reports.analysis.paired import COLLISION, METRIC, SUCCESS, TIE, Difference
from runners.reports.analysis.shared_worlds import (
    TASK,
    ComparedRun,
    Group,
    differing_conditions,
    differing_keys,
    groups,
    heading,
    run_names,
)
from runners.reports.analysis.summary import METRIC_COLUMNS, METRICS, SMOOTHNESS, barn_metric

if TYPE_CHECKING:
    import pandas as pd

MEASURES = {
    metric.key: metric
    for metric in METRICS
    if metric.key in (SUCCESS, COLLISION, METRIC, "time_s", "path_length_m", SMOOTHNESS)
}

# Columns that need not be read for a comparison, a third of all.
NOT_COMPARED = frozenset(COLUMNS) - {*KEY_COLUMNS, *TEXTS, *MEASURES, *TASK, "seed"}
_OF_MEASURES = (*KEY_COLUMNS, "outcome", *METRIC_COLUMNS, *MEASURES)  # of `paired.values`
EFFECT = 0.05  # difference in success for which the number of worlds is planned


@dataclass(frozen=True, slots=True)
class Change:
    """A measure over the pairs of two runs: means over worlds of reference and other run, and the difference."""

    reference: float
    other: float
    difference: Difference


@dataclass(frozen=True, slots=True)
class Compared:
    """A run compared with the reference.

    changes: by measure. worlds: a row per shared world, with the means `reference` and `other` of the drawn measure.
    """

    name: str
    run: ComparedRun
    changes: Mapping[str, Change]
    worlds: pd.DataFrame

    @property
    def better(self) -> list[int]:
        """Worlds in which the run is better than the reference."""
        return list(self.worlds.index[self._gain > TIE])

    @property
    def worse(self) -> list[int]:
        """Worlds in which the run is worse than the reference."""
        return list(self.worlds.index[self._gain < -TIE])

    @property
    def _gain(self) -> pd.Series:
        return self.worlds["other"] - self.worlds["reference"]

    @property
    def counts(self) -> str:
        """Numbers of worlds and pairs, such as "20 worlds, 60 pairs"."""
        pairs = self.changes[SUCCESS].difference.pairs
        return f"{counted(len(self.worlds), 'world')}, {counted(pairs, 'pair')}"


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Runs that share worlds with the reference. place: what all have in common. measure: the one drawn by world.

    notes: what a reader must know about the pairs. keys: of the configs that differ, with the value of each run.
    """

    reference: str
    run: ComparedRun
    place: str
    measure: str
    compared: list[Compared]
    notes: list[str]
    keys: Mapping[str, Sequence[object]]

    @property
    def names(self) -> list[str]:
        """Names of all runs, the reference first."""
        return [self.reference, *(compared.name for compared in self.compared)]


def compare_runs(frames: Iterable[pd.DataFrame]) -> list[RunComparison]:
    """Compare runs, each given by its records; return a comparison for each group that shares worlds.

    frames: from `read_runs`; the columns `NOT_COMPARED` may be missing. Raises InputError if there are fewer than two
    runs, or no two share an episode.
    """
    runs = [
        ComparedRun(Path(str(frame["run_dir"].iloc[0])), frame.dropna(axis="columns", how="all"))
        for frame in frames
    ]
    if len(runs) < 2:
        raise InputError(f"{runs[0].run_dir}: is a single run; give two or more runs, or a sweep")
    # Group the runs by the worlds that they share; a run without a partner is only mentioned.
    run_groups = groups(runs)
    together = [group for group in run_groups if group.others]
    if not together:
        drove = "; ".join(f"{run.run_dir} drove {_describe_worlds(run)}" for run in runs[:3])
        reason = (
            "; worlds with the same number have another start, goal or layout" if _share_numbers(runs) else ""
        )
        raise InputError(f"no two of these runs share an episode: {drove}{reason}")
    single_runs = [
        f"Left out: {group.reference.run_dir} shares no episode with another run; "
        f"it drove {_describe_worlds(group.reference)}."
        for group in run_groups
        if not group.others
    ]
    return [_comparison(group, single_runs) for group in together]


def _comparison(group: Group, notes: Sequence[str]) -> RunComparison:
    runs = group.runs
    reference, *names = run_names(runs)
    has_metric = all(METRIC in run.frame and barn_metric(run.frame).notna().any() for run in runs)
    measure = METRIC if has_metric else SUCCESS
    frames = {
        name: _measured(run.frame, worlds) for name, (run, worlds) in zip(names, group.others, strict=True)
    }
    # Differences from the reference, over all measures and by world for the drawn one.
    baseline = _measured(group.reference.frame, group.reference.worlds)
    changes = _changes(baseline, frames)
    baseline_values = paired.values(baseline, measure)
    compared = [
        Compared(name, run, changes[name], _by_world(baseline_values, paired.values(frames[name], measure)))
        for name, (run, _) in zip(names, group.others, strict=True)
    ]
    # Configs can be compared only if every run has one.
    launches = [launch for run in runs if (launch := read_launch(run.run_dir)) is not None]
    keys = differing_keys(launches) if len(launches) == len(runs) else {}
    return RunComparison(
        reference,
        group.reference,
        heading(runs),
        measure,
        compared,
        [*_notes(group, [reference, *names], keys, launches), *_describe_power(compared), *notes],
        keys,
    )


def _measured(frame: pd.DataFrame, worlds: Set[int]) -> pd.DataFrame:
    """Return the columns that measures are made of, in these worlds."""
    frame = frame[[name for name in frame if name in _OF_MEASURES]]
    return frame[frame["world"].isin(worlds)]


def _changes(baseline: pd.DataFrame, frames: Mapping[str, pd.DataFrame]) -> dict[str, dict[str, Change]]:
    """Return the changes of each run by name and measure; measures without pairs are left out."""
    changes: dict[str, dict[str, Change]] = {}
    for measure, metric in MEASURES.items():
        reference, variants = baseline, dict(frames)
        if metric.of_successes:
            reference = reference[reference["outcome"] == SUCCESS]
            variants = {name: frame[frame["outcome"] == SUCCESS] for name, frame in frames.items()}
        reference_values = paired.values(reference, measure)
        values = {name: paired.values(variant, measure) for name, variant in variants.items()}
        for name, difference in paired.compare_values(reference_values, values).items():
            worlds = _by_world(reference_values, values[name]).mean()
            change = Change(float(worlds["reference"]), float(worlds["other"]), difference)
            changes.setdefault(name, {})[measure] = change
    return changes


def _by_world(baseline: pd.Series, other: pd.Series) -> pd.DataFrame:
    """Return the means by world over the episodes that both have: columns `reference` and `other`."""
    import pandas as pd

    return pd.DataFrame({"reference": baseline, "other": other}).dropna().groupby("world").mean()


def _notes(
    group: Group, names: Sequence[str], keys: Mapping[str, Sequence[object]], launches: Sequence[Launch]
) -> list[str]:
    runs = group.runs
    lines = [
        _describe_unshared(group.reference, run, worlds, name)
        for (run, worlds), name in zip(group.others, names[1:], strict=True)
    ]
    lines += [
        f"Not finished: {name}, {missing}."
        for name, run in zip(names, runs, strict=True)
        if (missing := paired.row(run.frame).unfinished)
    ]
    # Say whether the episodes of a pair share their random numbers, and what else may explain a difference.
    seeds = list(dict.fromkeys(run.text("seed") for run in runs))
    lines.append(
        f"All have seed {seeds[0]}: both episodes of a pair draw from the same random numbers."
        if len(seeds) == 1
        else f"Seeds differ ({', '.join(seeds)}): pairs with another seed share the world, not the random numbers."
    )
    conditions = differing_conditions(keys, runs)
    if conditions:
        lines.append(f"Driven under different conditions: {'; '.join(conditions)}.")
    if len(launches) < len(runs):
        lines.append(
            "Not every run has a launch.json: robot, simulator and rules may differ in more than is shown."
        )
    versions = list(dict.fromkeys(launch.code for launch in launches if launch.code))
    if len(versions) > 1:
        lines.append(f"Driven by different versions: {'; '.join(versions)}.")
    lines += _describe_files(launches)
    return [line for line in lines if line]


def _share_numbers(runs: Sequence[ComparedRun]) -> bool:
    """Return whether two of the runs drove episodes of the same numbers, on maps of the same name."""
    return any(
        run.text("map") == other.text("map") and bool(np.isin(run.episodes, other.episodes).any())
        for run, other in combinations(runs, 2)
    )


def _describe_files(launches: Sequence[Launch]) -> list[str]:
    """Return a note on the user's own files that have changed from run to run under the same name; [] for none."""
    contents: dict[tuple[str, str, str], set[str]] = {}
    for entry in (entry for launch in launches for entry in launch.inputs):
        for name, file in entry.files.items():
            contents.setdefault((entry.key, entry.given, name), set()).add(file.sha256)
    changed = sorted({visible(Path(key[-1]).name) for key, digests in contents.items() if len(digests) > 1})
    return [f"Not the same in all of these runs: {', '.join(changed)}."] if changed else []


def _describe_unshared(reference: ComparedRun, run: ComparedRun, shared: frozenset[int], name: str) -> str:
    """Return a description of what two runs do not share; empty if every episode has a partner."""
    common, number = reference.worlds & run.worlds, len(shared)
    reasons = [
        f"{counted(len(worlds - common), 'world')} that only {whose} drove"
        for worlds, whose in ((reference.worlds, "the reference"), (run.worlds, "it"))
        if worlds - common
    ]
    if number < len(common):
        reasons.append(f"{counted(len(common) - number, 'world')} with another start, goal or layout")
    single = sum(world in shared for world in (np.setxor1d(reference.episodes, run.episodes) >> 32).tolist())
    if single:
        reasons.append(f"{counted(single, 'episode')} that only one of the two drove in shared worlds")
    return f"{name}: {counted(number, 'shared world')}; left out: {', '.join(reasons)}." if reasons else ""


def _describe_power(compared: Sequence[Compared]) -> list[str]:
    """Return a note on how many worlds it takes to find a difference of `EFFECT` in success, if that is known."""
    differences = [run.changes[SUCCESS].difference for run in compared]
    worlds = sorted(number for change in differences if (number := change.worlds_for(EFFECT)))
    if not worlds:
        return []
    fewest, most = f"{worlds[0]:,}", counted(worlds[-1], "world")
    number_text = most if worlds[0] == worlds[-1] else f"{fewest} to {most}"
    return [
        f"To find a difference of {EFFECT:g} in success takes about {number_text} like these "
        f"({paired.POWER:.0%} power at p < {paired.LEVEL:g}, by the spread of the paired differences)."
    ]


def _describe_worlds(run: ComparedRun) -> str:
    """Return "barn with crowd orca, 20 worlds from 0 to 285, run 0", or "runs 0 to 2" for several runs."""
    numbers, runs = run.worlds, sorted(run.frame["run"].unique())
    times = f"run {runs[0]}" if len(runs) == 1 else f"runs {runs[0]} to {runs[-1]}"
    map_text = run.text("map") + (f" with crowd {run.text('crowd')}" if run.text("crowd") else "")
    several = f"{counted(len(numbers), 'world')} from {min(numbers)} to {max(numbers)}"
    return f"{map_text}, {several if len(numbers) > 1 else f'world {min(numbers)}'}, {times}"
