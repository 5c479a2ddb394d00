"""Map sets and worlds in a terminal: a picture with text next to it."""

from __future__ import annotations

from collections.abc import Sequence

from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from lme.errors import InputError
from lme.worlds.world import Task
from runners.config.map_sets import Chosen, choose, known_path
from runners.figures.parts.extent import describe_set, extent, metres
from runners.figures.parts.style import BLUE, GREEN, VERMILION
from runners.figures.terminal.braille import GOAL, heading, picture

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
