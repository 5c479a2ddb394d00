"""The charts on the page of a training, as inline SVG that follows the theme; names appear on hovering."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from runners.config.escaping import html_text
from runners.config.space import PARAMETERS, Range
from runners.reports.analysis.paired import Difference
from runners.training.race import START, End, Race, Racer, driven_label, name_of, racers, worlds_driven
from runners.training.study import Trial

_RACE = (960, 400)  # width and height [px]
_PANEL = (280, 170)
_TRACK = (300, 18)
_BAR_PX = 120
_NAME_PX = 17  # least distance between two names


class _Plot(NamedTuple):
    """A rectangle on the page and the values at its sides. left, top, right, bottom [px]."""

    left: float
    top: float
    right: float
    bottom: float
    low: float
    high: float

    def y(self, value: float) -> float:
        return round(self.bottom - (value - self.low) / (self.high - self.low) * (self.bottom - self.top), 1)

    def grid(self, count: int) -> Iterator[str]:
        """Lines with their values."""
        for value in ticks(self.low, self.high, count):
            y = self.y(value)
            yield f'<line class="grid" x1="{self.left}" x2="{self.right}" y1="{y}" y2="{y}"/>'
            yield f'<text class="end" x="{self.left - 8}" y="{y + 4}">{figure(value, 2)}</text>'


def race_chart(race: Race, start: str) -> str:
    """A line per candidate: its mean reward after each rung, until it was dropped. start: name of the weights."""
    found = racers(race)
    seen = [value for racer in found if racer.raced for value in racer.values]
    width, height = _RACE
    room = 0.06 * max(max(seen) - min(seen), 0.02)
    plot = _Plot(56, 26, width - 210, height - 48, min(seen) - room, max(seen) + room)
    columns = _columns(plot, len(race.rungs))
    drawn = [racer for racer in found if racer.raced]
    parts = [
        *plot.grid(6),
        *(
            f'<text class="middle" x="{x}" y="{plot.bottom + 20}">{worlds_driven(rung)}</text>'
            for x, rung in zip(columns, race.rungs, strict=True)
        ),
        f'<text class="middle" x="{(plot.left + plot.right) / 2}" y="{height - 8}">'
        f"{driven_label(race)}</text>",
        f'<text class="first" x="0" y="{plot.top - 8}">mean reward so far</text>',
        _only_searched(found, plot, columns[0]),
        *(_line(racer, start, plot, columns) for racer in reversed(drawn)),
        *_names([one for one in drawn if len(one.values) == len(race.rungs)], start, plot),
    ]
    return _svg(_RACE, "race", "Mean reward against the worlds driven, one line per candidate", parts)


def race_key(race: Race) -> str:
    """What lines and their ends mean."""
    kind = "start" if race.winner == START else "won"
    start = '<line class="start" x1="0" x2="22" y1="6" y2="6"/>'
    marks = {
        f'<circle class="{kind}" cx="11" cy="6" r="6"/>': "winner",
        **({start: "start"} if START in race.rungs[0].values else {}),
        '<path d="M7 2l8 8m0 -8l-8 8"/>': "dropped: worse than the best beyond the noise",
        '<circle class="ring" cx="11" cy="6" r="4"/>': "dropped: outranked",
        '<circle cx="11" cy="6" r="4"/>': "came to the end",
    }
    items = (f"<li>{_svg((22, 12), '', '', [mark])}{text}</li>" for mark, text in marks.items())
    return f'<ul class="key">{"".join(items)}</ul>'


def scatter(
    key: str,
    space: Range,
    trials: Sequence[Trial],
    raced: frozenset[int],
    start: float | None,
    best: int,
) -> str:
    """The reward of every trial against its value of a key. raced: numbers of those that entered the race.

    start: its value. best: the number of the best trial. Both are marked.
    """
    width, height = _PANEL
    rewards = [trial.reward for trial in trials]
    room = 0.08 * max(max(rewards) - min(rewards), 0.02)
    plot = _Plot(42, 8, width - 8, height - 26, min(rewards) - room, max(rewards) + room)
    span = plot.right - plot.left
    at = {
        t.number: (round(plot.left + span * share(space, t.values[key]), 1), plot.y(t.reward)) for t in trials
    }
    name = html_text(short(key))
    parts = [
        *plot.grid(5),
        f'<path class="dots" d="{"".join(f"M{x} {y}h0" for number, (x, y) in at.items() if number not in raced)}"/>',
        *(
            f'<circle cx="{at[t.number][0]}" cy="{at[t.number][1]}" r="3"><title>trial {t.number}: {name} '
            f"{t.values[key]:.4g}, reward {figure(t.reward)}</title></circle>"
            for t in trials
            if t.number in raced
        ),
    ]
    if start is not None:
        x = round(plot.left + span * share(space, start), 1)
        parts.append(
            f'<line class="start" x1="{x}" x2="{x}" y1="{plot.top}" y2="{plot.bottom}">'
            f"<title>start: {start:.4g}</title></line>"
        )
    parts.append(f'<circle class="best" cx="{at[best][0]}" cy="{at[best][1]}" r="5"/>')
    for value, where, x in ((space.low, "first", plot.left), (space.high, "end", plot.right)):
        parts.append(f'<text class="{where}" x="{x}" y="{height - 8}">{value:g}</text>')
    return _svg(_PANEL, "scatter", f"Reward against {name}", parts)


def track(space: Range, start: float | None, best: float, name: str) -> str:
    """The place of both values in the range: a diamond for the start, a disc for the best trial, called `name`."""
    width, height = _TRACK
    inner, y = width - 16, height / 2
    parts = [f'<line class="rail" x1="8" x2="{width - 8}" y1="{y}" y2="{y}"/>']
    x = round(8 + inner * share(space, best), 1)
    parts.append(f'<circle class="best" cx="{x}" cy="{y}" r="5"><title>{name}: {best:.4g}</title></circle>')
    if start is not None:
        x = round(8 + inner * share(space, start), 1)
        outside = "" if space.low <= start <= space.high else ", outside the range"
        parts.append(
            f'<path class="start" d="M{x} {y - 6}l6 6l-6 6l-6 -6z"><title>start: {start:.4g}{outside}</title></path>'
        )
    return _svg(_TRACK, "track", "Place in the range", parts)


def bar(value: float, most: float) -> str:
    """A bar as long as the share of `value` in the largest one."""
    length = round(_BAR_PX * value / most, 1) if most > 0 else 0
    return _svg((_BAR_PX, 10), "bar", "", [f'<rect x="0" y="1" width="{length}" height="8" rx="2"/>'])


def change_bar(change: Difference, most: float) -> str:
    """An interval around zero. most: the end of the scale on both sides."""
    if math.isnan(change.low):
        return ""
    middle, half = _BAR_PX / 2, _BAR_PX / 2 - 4
    low, high, at = (
        round(middle + half * value / most, 1) for value in (change.low, change.high, change.mean)
    )
    kind = "up" if change.low > 0.0 else "down" if change.high < 0.0 else "level"
    parts = [
        f'<line class="zero" x1="{middle}" x2="{middle}" y1="0" y2="14"/>',
        f'<line class="whisker {kind}" x1="{low}" x2="{high}" y1="7" y2="7"/>',
        f'<circle class="{kind}" cx="{at}" cy="7" r="4"/>',
    ]
    return _svg((_BAR_PX, 14), "change", "", parts)


def share(space: Range, value: float) -> float:
    """The place of a value in its range, 0 to 1; values outside lie at the end."""
    inside = min(max(value, space.low), space.high)
    scale = math.log if space.log else float
    return (scale(inside) - scale(space.low)) / (scale(space.high) - scale(space.low))


def short(key: str) -> str:
    """A dotted key without what all parameters of a guide have in common."""
    return key.removeprefix(PARAMETERS)


def figure(value: float, digits: int = 3) -> str:
    """A rate or a reward, with a typographic minus."""
    return f"{value:.{digits}f}".replace("-", "\u2212")


def ticks(low: float, high: float, count: int) -> list[float]:
    """Round values between two bounds, about `count` of them."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough)
    return [step * index for index in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _columns(plot: _Plot, count: int) -> list[float]:
    """Where the rungs are."""
    step = (plot.right - plot.left - 28) / max(count - 1, 1)
    return [round(plot.left + 14 + step * index, 1) for index in range(count)]


def _only_searched(found: Sequence[Racer], plot: _Plot, x: float) -> str:
    """Dots for those that did not enter the race; those below the picture are counted."""
    values = [racer.values[0] for racer in found if not racer.raced]
    below = sum(value < plot.low for value in values)
    dots = "".join(f"M{x} {plot.y(value)}h0" for value in values if value >= plot.low)
    note = (
        f'<text class="first small" x="{x + 8}" y="{plot.bottom - 4}">{below} more below</text>'
        if below
        else ""
    )
    return f'<path class="dots" d="{dots}"/>{note}'


def _line(racer: Racer, start: str, plot: _Plot, columns: Sequence[float]) -> str:
    points = [(x, plot.y(value)) for x, value in zip(columns, racer.values, strict=False)]
    values = ", ".join(map(figure, racer.values))
    x, y = points[-1]
    return (
        f'<g class="{_kind(racer)}"><title>{html_text(name_of(racer.number, start))}: {values} ({racer.end})</title>'
        f'<polyline points="{" ".join(f"{px},{py}" for px, py in points)}"/>{_mark(racer, x, y)}</g>'
    )


def _mark(racer: Racer, x: float, y: float) -> str:
    """How the line ends: a cross for worse, a ring for outranked, a disc for one that came to the end."""
    if racer.end is End.worse:
        return f'<path class="cross" d="M{x - 4} {y - 4}l8 8m0 -8l-8 8"/>'
    kind = "ring" if racer.end is End.outranked else "disc"
    return f'<circle class="{kind}" cx="{x}" cy="{y}" r="{6 if racer.end is End.won else 3.5}"/>'


def _names(finalists: Sequence[Racer], start: str, plot: _Plot) -> Iterator[str]:
    """The names of those that came to the end, beside their lines, never over each other."""
    y = math.inf
    for racer in reversed(finalists):
        end = plot.y(racer.values[-1])
        y = min(end, y - _NAME_PX)
        yield f'<path class="leader" d="M{plot.right - 6} {end}L{plot.right + 12} {y}"/>'
        text = f"{html_text(name_of(racer.number, start))} {figure(racer.values[-1])}"
        yield f'<text class="first {_kind(racer)}" x="{plot.right + 16}" y="{y + 4}">{text}</text>'


def _kind(racer: Racer) -> str:
    if racer.number == START:
        return "start"
    return "won" if racer.end is End.won else "candidate"


def _svg(size: tuple[float, float], kind: str, label: str, parts: Sequence[str]) -> str:
    """label: for screen readers; "" if the figures stand beside it."""
    width, height = size
    role = f'role="img" aria-label="{label}"' if label else 'aria-hidden="true"'
    return f'<svg class="{kind}" viewBox="0 0 {width} {height}" {role}>{"".join(parts)}</svg>'
