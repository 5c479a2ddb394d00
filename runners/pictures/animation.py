"""An episode as a moving picture, driven anew: worlds with movers are not told by one still picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.episode import run_episode
from lme.geometry.frames import to_world
from lme.perception import obstacle_points
from lme.robots import Footprint, Robot
from lme.sim.simulator import Simulator, State
from lme.types import Floats, Guidance, Observation, Outcome, Pose, Twist
from lme.worlds.world import Task
from runners import build
from runners.episodes import episode_rng
from runners.pictures.scene import common_box, draw_task
from runners.pictures.style import BLUE, INK, ORANGE, PURPLE, STYLES, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN, DPI = 4.2, 100
MOST_FRAMES = 150  # of a longer episode every second, third, … decision is shown
LAST_S = 1.0  # the end stays so long
PATH, SCAN, SUBGOAL, MOVER = BLUE, ORANGE, PURPLE, "#444444"


class _Frame(NamedTuple):
    """One decision. obstacles: circles (C, 3) and edges (E, 4) then; points: (M, 2) of the scan, in the world."""

    time: float
    pose: Pose
    subgoal: Floats
    obstacles: tuple[Floats, Floats]
    points: Floats


class _Film:
    """Looks on and keeps what is to be drawn."""

    def __init__(self, simulator: Simulator, robot: Robot) -> None:
        self._simulator = simulator
        self._mount = robot.lidar.mount
        self.frames: list[_Frame] = []

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        self._keep(observation, to_world(guidance.subgoal, state.pose), state)

    def ended(self, observation: Observation, state: State) -> None:
        self._keep(observation, np.full(2, math.nan), state)

    def _keep(self, observation: Observation, subgoal: Floats, state: State) -> None:
        points = to_world(obstacle_points(observation.scan, self._mount), state.pose)
        self.frames.append(_Frame(state.time, state.pose, subgoal, self._simulator.obstacles, points))


def animate(config: Mapping[str, Any], world: int, run: int, path: Path) -> Outcome:
    """Drive one episode of a plain config as `lme eval` does, and save it as GIF; how it ended."""
    robot = build.robot(config)
    task, simulator = build.map_set(config).task(world), build.simulator(config, robot)
    film = _Film(simulator, robot)
    rng = episode_rng(config["seed"], world, run)
    episode = run_episode(task, build.navigator(config, robot), simulator, rng, film)
    _write(task, robot, film.frames, episode.outcome, path)
    return episode.outcome


def _write(task: Task, robot: Robot, frames: Sequence[_Frame], outcome: Outcome, path: Path) -> None:
    from matplotlib.animation import PillowWriter

    every = math.ceil(len(frames) / MOST_FRAMES)
    shown = [*frames[:-1:every], frames[-1]]
    positions = np.array([frame.pose[:2] for frame in frames])
    box = common_box([task], positions)
    height = WIDTH_IN * (box.y1 - box.y0) / (box.x1 - box.x0) + 0.3
    figure = new_figure(WIDTH_IN, height, DPI)
    axes = figure.add_subplot()
    axes.set(xlim=(box.x0, box.x1), ylim=(box.y0, box.y1), aspect="equal", xticks=[], yticks=[])
    draw_task(axes, task)
    stage = _Stage(axes, robot, task)
    rate = robot.control_rate / every
    writer = PillowWriter(fps=rate)  # type: ignore[arg-type]  # it takes fractions: 5 Hz, every second shown
    with writer.saving(figure, str(path), DPI):
        for number, frame in enumerate(shown):
            stage.show(frame, positions[: number * every + 1])
            writer.grab_frame()
        stage.end(outcome)
        for _ in range(math.ceil(LAST_S * rate)):
            writer.grab_frame()


class _Stage:
    """What changes from frame to frame."""

    def __init__(self, axes: Axes, robot: Robot, task: Task) -> None:
        from matplotlib.collections import LineCollection, PatchCollection

        self._axes = axes
        self._outline = _outline(robot.footprint)
        self._still = len(task.world.circles), len(task.world.edges)
        (self._trail,) = axes.plot([], [], color=PATH, linewidth=1.2, zorder=3)
        (self._scan,) = axes.plot([], [], ".", color=SCAN, markersize=1.5, zorder=4)
        (self._subgoal,) = axes.plot(
            [], [], "D", color=SUBGOAL, markersize=5, markeredgecolor="white", zorder=5
        )
        (self._robot,) = axes.fill([], [], color=PATH, zorder=6)
        self._discs = PatchCollection([], facecolor=MOVER, zorder=4)
        self._sides = LineCollection([], colors=MOVER, linewidths=1.5, zorder=4)
        axes.add_collection(self._discs)
        axes.add_collection(self._sides)

    def show(self, frame: _Frame, trail: Floats) -> None:
        """The moment of a frame."""
        from matplotlib.patches import Circle

        circles, edges = frame.obstacles
        discs = [Circle((x, y), radius) for x, y, radius in circles[self._still[0] :]]
        self._discs.set_paths(discs)
        self._sides.set_segments(list(edges[self._still[1] :].reshape(-1, 2, 2)))
        self._trail.set_data(*trail.T)
        self._scan.set_data(*frame.points.T)
        self._subgoal.set_data(frame.subgoal[:1], frame.subgoal[1:])
        self._robot.set_xy(to_world(self._outline, frame.pose))
        self._axes.set_title(f"{frame.time:.1f} s", fontsize=9, color=INK)

    def end(self, outcome: Outcome) -> None:
        """How it ended."""
        title = self._axes.get_title()
        self._axes.set_title(f"{title}: {outcome}", fontsize=9, color=STYLES[str(outcome)].colour)


def _outline(footprint: Footprint) -> Floats:
    """(V, 2) [m] of the rounded box."""
    half_length, half_width, rounding = footprint.box
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    parts = []
    for quarter, (x, y) in enumerate(corners):
        angles = np.linspace(quarter, quarter + 1, 7) * math.pi / 2
        centre = np.array([x * half_length, y * half_width])
        parts.append(centre + rounding * np.column_stack([np.cos(angles), np.sin(angles)]))
    return np.vstack(parts)
