"""Tables on the page of a training: held-out worlds, rungs, candidates, parameters, and the worst worlds."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from runners.config.escaping import html_text
from runners.config.space import PARAMETERS, Range, Space
from runners.records.episode_record import EpisodeKey
from runners.reports.analysis.failures import page_path
from runners.reports.analysis.paired import SUCCESS, Difference, interval, signed
from runners.reports.analysis.summary import DASH, TIMES
from runners.training.held_out import HeldOutComparison
from runners.training.race import START, End, Race, name_of, racers, worlds_by_family, worlds_driven

if TYPE_CHECKING:
    import pandas as pd

_DIGITS = 4  # significant digits of a parameter
_Key = tuple[str, EpisodeKey]
_LEFT = (
    "difference",
    "Worlds driven so far",
    "Best so far",
    "End",
    "Range",
    "Importance",
    "Worst run",
    "With the start",
)


@dataclass(frozen=True, slots=True)
class WorstWorld:
    """A world, represented by its worst episode. outcome, reward, time_s [s]: of this episode.

    runs, failed: number of episodes, and of failed ones. start_failed: failed ones of the start; None if the start is
    the result. lost: failed episodes of the result in which the start succeeded.
    """

    run_dir: Path
    key: EpisodeKey
    outcome: str
    reward: float
    time_s: float
    runs: int
    failed: int
    start_failed: int | None
    lost: int


def worst_worlds(frame: pd.DataFrame, start: pd.DataFrame | None, count: int) -> list[WorstWorld]:
    """Return at most `count` worlds: those with failures first, then those with the lowest reward.

    Among equal ones, those where the start succeeded most often come first. frame, start: records with their
    `run_dir` and the column `reward`; maps have directories of the same name. start: None if the start is the result.
    """
    start_successes = None if start is None else _succeeded_keys(start)
    by_world: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for row in frame.to_dict("records"):
        by_world.setdefault((str(row["run_dir"]), int(row["world"])), []).append(row)
    worlds = [_world(rows, start_successes) for rows in by_world.values()]
    worlds.sort(key=lambda world: (world.outcome == SUCCESS, world.reward, -world.lost, -world.failed))
    return worlds[:count]


def regressions(frame: pd.DataFrame, start: pd.DataFrame) -> int:
    """Return the number of episodes in which the result fails where the start succeeded."""
    start_successes = _succeeded_keys(start)
    return sum(_failed(row) and _key(row) in start_successes for row in frame.to_dict("records"))


def _world(rows: Sequence[Mapping[str, Any]], start_successes: set[_Key] | None) -> WorstWorld:
    failed = [row for row in rows if _failed(row)]
    regressed = [row for row in failed if start_successes is not None and _key(row) in start_successes]
    worst = min(rows, key=lambda row: (not _failed(row), row["reward"], row not in regressed))
    return WorstWorld(
        Path(worst["run_dir"]),
        EpisodeKey.of(worst),
        str(worst["outcome"]),
        float(worst["reward"]),
        float(worst["time_s"]),
        len(rows),
        len(failed),
        None if start_successes is None else sum(_key(row) not in start_successes for row in rows),
        len(regressed),
    )


def _failed(row: Mapping[str, Any]) -> bool:
    return bool(row["outcome"] != SUCCESS)


def _succeeded_keys(start: pd.DataFrame) -> set[_Key]:
    """Return the episodes in which the start succeeded."""
    return {_key(row) for row in start.to_dict("records") if not _failed(row)}


def _key(row: Mapping[str, Any]) -> _Key:
    """Return what an episode of the result and one of the start have in common: the map and the key."""
    return Path(row["run_dir"]).name, EpisodeKey.of(row)


def held_out_table(comparisons: Mapping[str, HeldOutComparison], is_start: bool) -> str:
    """Write one line per map, and one of all if there are several. is_start: the start won, so nothing differs."""
    rows = list(comparisons.items()) if len(comparisons) > 2 else list(comparisons.items())[:1]
    if is_start:
        lines = [
            [_th(name), _episodes(row), rounded(row.success), rounded(row.collision), rounded(row.reward)]
            for name, row in rows
        ]
        return _table(["Map", "Episodes", "Success", "Collision", "Reward"], lines, "held-out")
    lines = [
        [
            _th(name),
            _episodes(row),
            rounded(row.start_success),
            f"<b>{rounded(row.success)}</b>",
            _change(row.success_difference),
            rounded(row.start_collision),
            f"<b>{rounded(row.collision)}</b>",
            _change(row.collision_difference),
            rounded(row.start_reward),
            f"<b>{rounded(row.reward)}</b>",
            _change(row.reward_difference),
        ]
        for name, row in rows
    ]
    heads = ["Map", "Episodes", *["start", "result", "difference"] * 3]
    groups = "".join(f'<th colspan="3">{measure}</th>' for measure in ("Success", "Collision", "Reward"))
    groups = f'<tr class="groups"><td colspan="2"></td>{groups}</tr>'
    return _table(heads, lines, "held-out", groups)


def rung_table(race: Race, start: str) -> str:
    """Write one line per rung: worlds driven, candidates dropped after it, and the best and the start so far."""
    field, has_start = racers(race), START in race.rungs[0].values
    lines = []
    for index, rung in enumerate(race.rungs):
        ends = [racer.end for racer in field if len(racer.values) == index + 1]
        best = next(iter(rung.values))
        families = ", ".join(f"{html_text(name)} {count}" for name, count in worlds_by_family(rung).items())
        lines.append([
            _th("Search" if index == 0 else f"Rung {index}"),
            families,
            str(len(rung.values)),
            _count(ends.count(End.worse)),
            _count(ends.count(End.outranked)),
            f"{html_text(name_of(best, start))} <b>{rounded(rung.values[best])}</b>",
            *([rounded(rung.values[START])] if has_start else []),
        ])  # fmt: skip
    heads = [
        "",
        "Worlds driven so far",
        "Candidates",
        "Worse",
        "Outranked",
        "Best so far",
        *["Start"] * has_start,
    ]
    return _table(heads, lines, "rungs")


def candidate_table(race: Race, start: str) -> str:
    """Write one line per candidate that raced, with its mean reward after each rung, the best first."""
    lines = [
        [
            _th(name_of(racer.number, start), "start" if racer.number == START else ""),
            *map(rounded, racer.values),
            *[DASH] * (len(race.rungs) - len(racer.values)),
            f"<b>{racer.end}</b>" if racer.end is End.won else str(racer.end),
        ]
        for racer in racers(race)
        if racer.raced
    ]
    heads = ["Candidate", *(f"{worlds_driven(rung)} worlds" for rung in race.rungs), "End"]
    return _table(heads, lines, "candidates")


def parameter_table(
    space: Space,
    start: Mapping[str, float | None],
    best: Mapping[str, float],
    name: str,
    importances: Mapping[str, float],
) -> str:
    """Write one line per searched key: both values, the range, and the importance of the key.

    best: values of the best trial. name: heading of their column.
    """
    lines = []
    for key, bounds in space.items():
        weight = importances.get(key)
        lines.append([
            f'<th scope="row">{breakable(short(key))}</th>',
            _start_value(bounds, start.get(key)),
            f"<b>{_value(best[key])}</b>",
            f"{bounds.low:g} to {bounds.high:g}{', log' if bounds.log else ''}",
            *([DASH if weight is None else f"{weight:.2f}"] if importances else []),
        ])  # fmt: skip
    heads = ["Parameter", "Start", name, "Range", *["Importance"] * bool(importances)]
    return _table(heads, lines, "parameters")


def worst_table(worlds: Sequence[WorstWorld], directory: Path) -> str:
    """Write one line per world, with a link to its page if it has one. directory: folder that links start from."""
    compared = any(world.start_failed is not None for world in worlds)
    lines = []
    for world in worlds:
        flag = ' <span class="flag">start was better</span>' if world.lost else ""
        page = page_path(world.run_dir, world.key)
        link = f' <a href="{quote(os.path.relpath(page, directory))}">why</a>' if page.is_file() else ""
        lines.append([
            f'<th scope="row">{html_text(world.run_dir.name)} {world.key.world}{link}</th>',
            f'<span class="outcome {html_text(world.outcome)}">{html_text(world.outcome)}</span>',
            rounded(world.reward),
            f"{world.time_s:.1f}",
            f"{world.failed} of {world.runs}",
            *([f"{world.start_failed} of {world.runs}{flag}"] if compared else []),
        ])  # fmt: skip
    heads = ["World", "Worst run", "Reward", "Time [s]", "Failed runs", *["With the start"] * compared]
    return _table(heads, lines, "worst")


def short(key: str) -> str:
    """Return a dotted key without the prefix that all parameters of a guide share."""
    return key.removeprefix(PARAMETERS)


def rounded(value: float) -> str:
    """Return a rate or a reward as text, with a typographic minus."""
    return f"{value:.3f}".replace("-", "\u2212")


def breakable(text: str) -> str:
    """Return text as HTML whose lines may break between the words of a key or a path, but not within them."""
    return "<wbr>".join(map(html_text, re.split(r"(?<=[._/=:,])(?=\w)", text)))


def _table(heads: Sequence[str], lines: Iterable[Sequence[str]], kind: str, head_row: str = "") -> str:
    """Return lines of cells as HTML; a cell may already be a <th>. Numbers are aligned right, other columns left."""
    sides = [' class="left"' if head in _LEFT else "" for head in heads]
    head = "".join(f'<th scope="col"{side}>{head}</th>' for head, side in zip(heads, sides, strict=True))
    body = "\n".join(f"<tr>{''.join(map(_cell, line, sides))}</tr>" for line in lines)
    return (
        f'<div class="wide" tabindex="0" role="region" aria-label="{kind}"><table class="{kind}">\n'
        f"<thead>{head_row}<tr>{head}</tr></thead>\n<tbody>{body}</tbody>\n</table></div>"
    )


def _cell(text: str, side: str) -> str:
    return text if text.startswith("<th") else f"<td{side}>{text}</td>"


def _th(text: str, kind: str = "") -> str:
    return f'<th scope="row"{f" class={kind}" if kind else ""}>{html_text(text)}</th>'


def _episodes(row: HeldOutComparison) -> str:
    return f"{row.worlds} {TIMES} {row.runs}" if row.runs > 1 else str(row.worlds)


def _change(change: Difference) -> str:
    bounds = interval(change)
    interval_html = f"<small>{bounds}</small>" if bounds else ""
    return f"{signed(change.mean)}{interval_html}"


def _count(number: int) -> str:
    return str(number) if number else DASH


def _value(value: float) -> str:
    return f"{value:.{_DIGITS}g}"


def _start_value(bounds: Range, value: float | None) -> str:
    if value is None:
        return DASH
    return (
        _value(value)
        if bounds.low <= value <= bounds.high
        else f"{_value(value)}<small>outside the range</small>"
    )
