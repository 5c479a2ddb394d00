"""Map sets and worlds in a terminal: a picture with text next to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.style import Style
from rich.table import Table
from rich.text import Text

from lme.errors import InputError
from lme.types import Bools, Floats
from lme.worlds.clearance import clearance_field
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.movers import Mover
from lme.worlds.world import Task, World
from runners.config.map_sets import Chosen, choose, known_path
from runners.reports.figures.layout import describe_set, extent, metres, mover_outline
from runners.reports.figures.scene import Box
from runners.reports.figures.style import BLUE, GREEN, VERMILION

GOAL, START = "★", "→↗↑↖←↙↓↘"  # the start by its heading, in eighths of a turn from the x axis
_ACROSS, _DOWN = 2, 4  # dots of a character
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # of Unicode, from the top
_FINE = 3  # samples across a dot: a line then fills a third of every dot that it crosses
_FILLED = 0.3  # share of a dot's samples that sets it


class _Lattice(NamedTuple):
    """The grid of dots. corner: lower left of the picture [m]. step: distance between dots [m]."""

    corner: Floats
    step: float
    columns: int  # characters
    lines: int


def picture(task: Task, columns: int, lines: int, path: Floats | None = None) -> Text:
    """The world, y up, at equal scale on both axes, in at most `columns` × `lines` characters.

    Obstacles are filled; movers are hollow, at their first pose. An arrow marks the start, a star the goal. path:
    (P, 2), drawn too [m].
    """
    lattice = _fit_lattice(extent(task), columns, lines)
    layers = [(_dots(task.world, lattice), "")]
    if path is not None:
        layers.append((_dots(World(segments=np.hstack([path[:-1], path[1:]])), lattice), BLUE))
    if task.world.movers:
        layers.append((_dots(_outlines(task.world.movers), lattice), VERMILION))
    characters, styles = _colour_characters(layers, lattice)
    for glyph, colour, place in ((heading(task), GREEN, task.start[:2]), (GOAL, VERMILION, task.goal)):
        line, column = _character(np.array(place), lattice)
        characters[line][column], styles[line][column] = glyph, colour
    return _text(characters, styles)


def heading(task: Task) -> str:
    """The arrow nearest to the robot's heading at the start."""
    return START[round(task.start.yaw / (math.pi / 4)) % len(START)]


def _outlines(movers: Sequence[Mover]) -> World:
    corners = [mover_outline(mover) for mover in movers]
    return World(segments=np.vstack([np.hstack([each, np.roll(each, -1, axis=0)]) for each in corners]))


def _fit_lattice(box: Box, columns: int, lines: int) -> _Lattice:
    """The finest lattice that holds the box; the box's edges run through the middles of dots."""
    size = np.array([box.x1 - box.x0, box.y1 - box.y0])
    most = np.array([columns * _ACROSS, lines * _DOWN])
    step = float((size / (most - 1)).max())
    needed = np.floor(size / step + 1.0 + 1e-9)
    across, down = math.ceil(needed[0] / _ACROSS), math.ceil(needed[1] / _DOWN)
    spare = np.array([across * _ACROSS, down * _DOWN]) * step - size
    return _Lattice(np.array([box.x0, box.y0]) - spare / 2, step, across, down)


def _dots(world: World, lattice: _Lattice) -> Bools:
    """(dots down, dots across) whether obstacles fill each dot; the first row is the top."""
    fine = lattice.step / _FINE
    across, down = lattice.columns * _ACROSS, lattice.lines * _DOWN
    x = lattice.corner[0] + (np.arange(across * _FINE) + 0.5) * fine
    y = lattice.corner[1] + (np.arange(down * _FINE) + 0.5) * fine
    outline = np.array([[x[0], y[0]], [x[-1], y[0]], [x[-1], y[-1]], [x[0], y[-1]]]) + fine * np.array(
        [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    )
    covered = clearance_field(FloorPlan(world, outline), x, y, fine) <= fine / 2 * (1 + 1e-9)
    shares = covered.reshape(down, _FINE, across, _FINE).mean(axis=(1, 3))
    return np.asarray(shares[::-1] >= _FILLED)


def _colour_characters(
    layers: Sequence[tuple[Bools, str]], lattice: _Lattice
) -> tuple[list[list[str]], list[list[str]]]:
    """Characters and their colours, line by line; the last layer that has a dot in a character colours it."""
    shape = (lattice.lines, _DOWN, lattice.columns, _ACROSS)
    codes = np.zeros((lattice.lines, lattice.columns), dtype=np.int64)
    colours = np.full(codes.shape, "", dtype=object)
    for dots, colour in layers:
        bits = (dots.reshape(shape).transpose(0, 2, 1, 3) * _BITS).sum(axis=(2, 3))
        codes |= bits
        colours[bits > 0] = colour
    # A space for the empty Braille character: some fonts draw that as eight small rings.
    return [[chr(0x2800 + code) if code else " " for code in row] for row in codes.tolist()], colours.tolist()


def _character(place: Floats, lattice: _Lattice) -> tuple[int, int]:
    """Line and column of the character that a point (2,) [m] lies in."""
    column, row = np.floor((place - lattice.corner) / lattice.step).astype(int).tolist()
    return lattice.lines - 1 - row // _DOWN, column // _ACROSS


def _text(characters: Sequence[Sequence[str]], styles: Sequence[Sequence[str]]) -> Text:
    text = Text(no_wrap=True)
    for number, (line, colours) in enumerate(zip(characters, styles, strict=True)):
        if number:
            text.append("\n")
        for character, colour in zip(line, colours, strict=True):
            text.append(character, Style(color=colour, bold=colour != "") if colour else None)
    return text


SMALL_COLUMNS, SMALL_LINES, TALL_LINES = 16, 6, 9  # of a thumbnail; a tall world gets more lines
MIDDLE_COLUMNS, MIDDLE_LINES = 24, 12  # of one world among several
LARGE_LINES = 32  # of a single world, at least


def set_entry(name: str, title: str) -> RenderableType:
    """A map set: its title and a picture of its first world, or the reason why there is no picture."""
    text, small = Text.assemble((name, "bold"), "\n", title, "\n"), Text()
    try:
        chosen = choose([name])
        task = chosen.maps.task(chosen.maps.numbers[0])
        small = _thumbnail(task)
        text.append(describe_set(chosen, task).replace("\n", " · "), "dim")
    except InputError as error:
        text.append(f"no picture: {error}", "dim")
    row = Table.grid(padding=(0, 2, 0, 0))
    row.add_column(width=SMALL_COLUMNS)
    row.add_column()
    row.add_row(small, text)
    return row


def several_worlds(tasks: Sequence[Task]) -> RenderableType:
    """Pictures of worlds, each below its number, in as many columns as fit."""
    pictures = [
        Text.assemble((f"{task.number}\n", "bold"), picture(task, MIDDLE_COLUMNS, MIDDLE_LINES), "\n")
        for task in tasks
    ]
    return Columns(pictures, padding=(0, 3))


def one_world(chosen: Chosen, task: Task, console: Console) -> RenderableType:
    """A world as large as the terminal allows, with facts next to it if they fit, else below."""
    way = known_path(chosen.maps, task)
    drawn = picture(task, console.width, max(LARGE_LINES, console.height - 4), way)
    facts = Group(
        Text(f"{chosen.name} {task.number}", "bold"),
        _facts(task, chosen.robot.name),
        Text(),
        _key(task, way is not None),
    )
    across = console.measure(drawn).maximum
    if across + 3 + console.measure(facts).maximum > console.width:
        return Group(drawn, Text(), facts)
    row = Table.grid(padding=(0, 3, 0, 0))
    row.add_row(drawn, facts)
    return row


def _thumbnail(task: Task) -> Text:
    box = extent(task)
    tall = box.y1 - box.y0 > 1.1 * (box.x1 - box.x0)
    return picture(task, SMALL_COLUMNS, TALL_LINES if tall else SMALL_LINES)


def _facts(task: Task, robot: str) -> Table:
    facts = {
        "robot": robot,
        "size": metres(task),
        "optimal time": f"{task.optimal_time:.3f} s",
        "shortest path": f"{task.shortest_path_length:.2f} m",
        "start": f"{task.start.x:.2f}, {task.start.y:.2f} m",
        "goal": f"{task.goal[0]:.2f}, {task.goal[1]:.2f} m",
        "reached within": f"{task.goal_tolerance:g} m",
        "time limit": f"{task.time_limit:g} s",
        **{name: f"{value:.4g}" for name, value in task.measures.items()},
    }
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="dim", no_wrap=True)
    table.add_column()
    for name, value in facts.items():
        table.add_row(name, value)
    return table


def _key(task: Task, with_way: bool) -> Text:
    """The key to the characters of the picture."""
    key = Text.assemble((heading(task), f"bold {GREEN}"), " start  ", (GOAL, f"bold {VERMILION}"), " goal")
    if with_way:
        key.append("  ⠤⠤", f"bold {BLUE}").append(" optimal path")
    if task.world.movers:
        key.append("  ⢎⡱", f"bold {VERMILION}").append(" moves")
    return key
