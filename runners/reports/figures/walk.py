"""A film of robots that walk in MuJoCo, by MuJoCo's own renderer, which needs no display."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lme.errors import InputError, require
from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.arena import Arena
from lme.simulation.mujoco.body import add_robot
from lme.types import Floats, Outcome
from runners.reports.figures.animation import SAMPLE, Picture, write_film
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.scene import Box, common_box
from runners.reports.figures.style import GREEN, INK, STYLES, VERMILION
from runners.reports.figures.video import FilmConfig, labels_of, pace_of, select_episodes, with_progress
from runners.workers.trace import Trace

HEADER_PX, FONT_PX = 22, 13
GAP_PX = 4  # between views
OVERVIEW = 0.62  # share of the width for the view of the whole world; the rest follows the robot
CLOSE_M, CLOSE_ELEVATION = 1.15, 30.0  # [m] that the following view is high, [deg] of its camera
FOVY = 20.0  # [deg] vertical field of view; a narrow one distorts little
WALL_M, HALF_THICKNESS_M = 0.25, 0.015  # of the obstacles in the film: higher ones would hide the robot
SHADOW_PX = (
    2048  # of the map of shadows: with 4096 of MuJoCo, they take half of the time without a graphics card
)
GRID_M = 1.0  # between lines on the floor
FLOOR, OBSTACLE, TRAIL = (0.93, 0.93, 0.92, 1.0), (0.80, 0.70, 0.52, 1.0), (0.0, 0.45, 0.70, 1.0)
LINE = (0.80, 0.80, 0.79, 1.0)
ROBOT = {"trunk": (0.22, 0.24, 0.27, 1.0), "foot": (0.84, 0.37, 0.0, 1.0)}
LEG = (0.45, 0.48, 0.52, 1.0)
TRAIL_EVERY = 10  # postures, which are 10 ms apart
TRAIL_M = 0.012  # radius of the line behind the robot
LIGHT = (0.3, 0.4, -1.0)  # direction
AROUND = 1.04  # room around the world in the picture


@dataclass(slots=True)
class WalkConfig(FilmConfig):
    """Appearance of a film, and the elevation of its camera [deg]."""

    elevation: float

    def __post_init__(self) -> None:
        FilmConfig.__post_init__(self)
        require("elevation", self.elevation, at_least=20.0, at_most=90.0)


class Walk:
    """The kind `walk` of `lme figure`."""

    Config = WalkConfig
    name = "walk"
    drives = True
    guided = None

    def __init__(self, config: WalkConfig) -> None:
        self._config = config

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Save the film of the runs as `stem`.gif or `stem`.mp4, and return its path. formats: ignored.

        Raises InputError for too many panels, for runs that did not walk in MuJoCo, or without OpenGL.
        """
        config = self._config
        episodes = select_episodes(runs, worlds)
        traces = [driven_run.trace(world, run) for driven_run, world, run in episodes]
        for trace in traces:
            check_walked(trace)
        pace, speed = pace_of(traces, config.speed, config.fps)
        note = "" if speed == 1.0 else f", {speed:.3g}× real time"
        films = [
            _Film(trace, label, note, config.width, config.elevation)
            for trace, label in zip(traces, labels_of(episodes), strict=True)
        ]
        path = stem.with_name(f"{stem.name}.{config.format}")
        pictures = with_progress(_pictures(films, pace.held), len(pace.held))
        sampled = pace.times[np.linspace(0, len(pace.times) - 1, SAMPLE).round().astype(int)]
        write_film(pictures, path, pace.fps, list(_pictures(films, sampled)))
        return [path]


def check_walked(trace: Trace) -> None:
    """Raise InputError unless a trace can be filmed."""
    if trace.end.postures is None:
        raise InputError(
            f"sim is {trace.config.sim['_target_']}: figure=walk films a robot with legs, so choose "
            "sim=mujoco with robot=go2, or figure=video"
        )
    if trace.task.world.movers:
        raise InputError(
            f"map is {trace.task.map_name}: figure=walk films worlds without movers; choose figure=video"
        )


def _pictures(films: Sequence[_Film], times: Floats) -> Iterator[Picture]:
    """Yield the pictures at these times, one episode above the other."""
    for time in times:
        yield np.vstack([film.at(float(time)) for film in films])


class _Film:
    """The views of one episode: the whole world at the left, the robot at the right."""

    def __init__(self, trace: Trace, label: str, note: str, width: int, elevation: float) -> None:
        import mujoco

        self._trace, self._label, self._note = trace, label, note
        rows = np.vstack([frame.postures for frame in trace.frames if frame.postures is not None])
        self._times, self._postures = rows[:, 0], rows[:, 1:]
        arena = Arena(trace.task.world, Crowd(()), add_robot)
        self._model = model = arena.model
        self._data = mujoco.MjData(model)
        _paint(model, arena.parts)
        # Sizes of the views; films need even ones.
        self._box = box = common_box([trace.task], np.array([frame.pose[:2] for frame in trace.frames]))
        tilt, overview = math.radians(elevation), round(OVERVIEW * width)
        height = 2 * round(overview * (box.y1 - box.y0) * math.sin(tilt) / (box.x1 - box.x0) / 2)
        self._widths, self._height = (overview, width - overview - GAP_PX), height
        # Both cameras look along +y, so that x points to the right.
        self._overview, self._close = mujoco.MjvCamera(), mujoco.MjvCamera()
        self._overview.lookat[:] = (box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2, 0.0
        self._overview.distance = _distance(box, tilt, overview / height)
        self._close.distance = CLOSE_M / 2 / math.tan(math.radians(FOVY / 2))
        self._overview.azimuth = self._close.azimuth = 90.0
        self._overview.elevation, self._close.elevation = -elevation, -CLOSE_ELEVATION
        # OpenGL draws into a buffer of the larger view's size.
        model.vis.global_.fovy, model.vis.quality.shadowsize = FOVY, SHADOW_PX
        model.vis.global_.offwidth, model.vis.global_.offheight = max(self._widths), height
        self._gl = open_gl(max(self._widths), height)
        self._gl.make_current()
        lines = round((box.x1 - box.x0 + box.y1 - box.y0) / GRID_M) + 2
        shapes = model.ngeom + len(self._times) // TRAIL_EVERY + lines + 10
        self._scene = mujoco.MjvScene(model, maxgeom=shapes)
        self._render = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)

    def at(self, time: float) -> Picture:
        """Return the picture at this time, (height, width, 3), with a line of text above it."""
        index = max(int(np.searchsorted(self._times, time + 1e-9, side="right")) - 1, 0)
        self._close.lookat[:] = *self._postures[index, :2], 0.15
        gap = np.full((self._height, GAP_PX, 3), 255, np.uint8)
        overview, close = (
            self._view(index, camera, width)
            for camera, width in zip((self._overview, self._close), self._widths, strict=True)
        )
        return np.vstack([self._header(time), np.hstack([overview, gap, close])])

    def _view(self, index: int, camera: Any, width: int) -> Picture:
        """Return what a camera sees of a posture."""
        import mujoco

        # Put the robot where it is, and add the floor's grid, the goal, the way so far and a light to the scene.
        self._data.qpos[:] = self._postures[index]
        mujoco.mj_forward(self._model, self._data)
        scene, everything = self._scene, mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, mujoco.MjvOption(), None, camera, everything, scene)
        self._add_grid()
        self._add_goal()
        self._add_trail(self._postures[: index + 1 : TRAIL_EVERY, :2])
        _light(scene)
        # Draw, and read the picture, whose first row is the lowest.
        self._gl.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._render)
        rectangle = mujoco.MjrRect(0, 0, width, self._height)
        mujoco.mjr_render(rectangle, scene, self._render)
        picture = np.empty((self._height, width, 3), np.uint8)
        mujoco.mjr_readPixels(picture, None, rectangle, self._render)
        return picture[::-1]

    def _header(self, time: float) -> Picture:
        from PIL import Image, ImageDraw, ImageFont

        over, outcome = time >= self._times[-1] - 1e-9, Outcome(self._trace.episode.outcome)
        clock = f"{min(time, self._times[-1]):.1f} s{self._note}"
        width = sum(self._widths) + GAP_PX
        image = Image.new("RGB", (width, HEADER_PX), "white")
        draw, font = ImageDraw.Draw(image), ImageFont.load_default(FONT_PX)
        middle = HEADER_PX // 2
        draw.text((6, middle), self._label, INK, font, anchor="lm")
        text, colour = (f"{outcome}, {clock}", STYLES[outcome].colour) if over else (clock, INK)
        draw.text((width - 6, middle), text, colour, font, anchor="rm")
        return np.asarray(image)

    def _add_grid(self) -> None:
        import mujoco

        (x0, y0, x1, y1), box = self._box, mujoco.mjtGeom.mjGEOM_BOX
        thin, middle = 0.004, ((x0 + x1) / 2, (y0 + y1) / 2)
        for x in np.arange(math.ceil(x0), x1, GRID_M):
            self._add(box, np.array([thin, (y1 - y0) / 2, 0.0005]), np.array([x, middle[1], 0.0]), LINE)
        for y in np.arange(math.ceil(y0), y1, GRID_M):
            self._add(box, np.array([(x1 - x0) / 2, thin, 0.0005]), np.array([middle[0], y, 0.0]), LINE)

    def _add_goal(self) -> None:
        import mujoco

        task = self._trace.task
        size = np.array([task.goal_tolerance, 0.004, 0.0])
        self._add(mujoco.mjtGeom.mjGEOM_CYLINDER, size, np.array([*task.goal, 0.004]), _rgba(GREEN, 0.6))
        pole = np.array([0.015, 0.2, 0.0])
        self._add(mujoco.mjtGeom.mjGEOM_CYLINDER, pole, np.array([*task.goal, 0.2]), _rgba(VERMILION, 1.0))

    def _add_trail(self, points: Floats) -> None:
        import mujoco

        for start, end in itertools.pairwise(points):
            line = self._add(mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), TRAIL)
            capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
            mujoco.mjv_connector(line, capsule, TRAIL_M, np.array([*start, 0.01]), np.array([*end, 0.01]))

    def _add(self, kind: Any, size: Floats, position: Floats, rgba: tuple[float, ...]) -> Any:
        """Add a shape to the scene, and return it."""
        import mujoco

        scene = self._scene
        shape = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(shape, kind, size, position, np.eye(3).ravel(), np.array(rgba, np.float32))
        scene.ngeom += 1
        return shape


def _paint(model: Any, parts: Sequence[str]) -> None:
    """Colour the shapes of a model by what they belong to, and make its obstacles low and walls thick."""
    import mujoco

    for i, body in enumerate(model.geom_bodyid):
        if body != 0:  # of the robot; the floor and the obstacles belong to the world, body 0
            model.geom_rgba[i] = ROBOT.get(parts[i], LEG)
            continue
        is_floor = model.geom_type[i] == mujoco.mjtGeom.mjGEOM_PLANE
        model.geom_rgba[i] = FLOOR if is_floor else OBSTACLE
        if is_floor:
            continue
        is_round = model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CYLINDER
        model.geom_size[i, 1 if is_round else 2] = model.geom_pos[i, 2] = WALL_M / 2
        if not is_round:
            model.geom_size[i, 1] = HALF_THICKNESS_M


def _distance(box: Box, tilt: float, aspect: float) -> float:
    """Distance of a camera from the middle of a box that its picture shows as a whole [m].

    tilt: elevation of the camera [rad]. aspect: width over height of the picture. The near edge of the box is the
    widest in the picture.
    """
    slope = math.tan(math.radians(FOVY / 2))
    half_width, half_depth = (box.x1 - box.x0) / 2, (box.y1 - box.y0) / 2
    nearer = half_depth * math.cos(tilt)
    return AROUND * max(half_width / (slope * aspect), half_depth * math.sin(tilt) / slope) + nearer


def _rgba(colour: str, alpha: float) -> tuple[float, ...]:
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), alpha)


def _light(scene: Any) -> None:
    """Add a light that casts shadows to a scene."""
    light = scene.lights[scene.nlight]
    light.id, light.headlight, light.castshadow = -1, 0, 1
    light.type = 1  # directional
    light.pos[:], light.dir[:] = -4.0 * np.array(LIGHT), np.array(LIGHT) / np.linalg.norm(LIGHT)
    light.ambient[:], light.diffuse[:], light.specular[:] = 0.1, 0.5, 0.1
    scene.nlight += 1


def open_gl(width: int, height: int) -> Any:
    """Return an OpenGL context without a window. Raises InputError if there is no OpenGL."""
    try:
        if sys.platform == "linux":
            from mujoco.egl import GLContext  # also where there is no display
        else:
            from mujoco import GLContext
        return GLContext(width, height)
    except Exception as error:  # libraries that are missing raise whatever their loaders raise
        raise InputError(
            f"figure=walk needs OpenGL without a display (Debian: apt install libegl1 libgl1-mesa-dri): {error}"
        ) from error
