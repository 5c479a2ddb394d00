"""Pictures of a replay: the path with the proposed subgoals, and the first scan; and a file for rerun's viewer."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_robot, to_world
from lme.live.scan_source import ScanSource
from lme.perception.scan_points import obstacle_points
from lme.requirements import install
from lme.robots import Robot
from lme.types import Floats
from runners.recordings.driver import Log, ReplayStep
from runners.recordings.recording import Recording
from runners.reports.figures.scene import pointer
from runners.reports.figures.style import INK, OBSTACLE, new_figure, save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


PROPOSED, RECORDED, GOAL = "#D55E00", "#0072B2", "#009E73"
_FADED: dict[str, Any] = {"linewidth": 0.8, "alpha": 0.6}
EDGE, EDGE_M = 0.02, 0.3  # shown around everything on the map: share of its longer side, and metres
_SEEN_M = 8.0  # largest distance shown around the robot in the picture of one scan
_BLUE, _ORANGE, _GREEN, _GREY = (0, 114, 178), (213, 94, 0), (0, 158, 115), (120, 120, 120)


def write(
    frame: pd.DataFrame, log: Log, scan_source: ScanSource, recording: Recording, run_dir: Path
) -> list[Path]:
    """Write `replay.png` and `orientation.png` into `run_dir`; return their paths."""
    replay, orientation = run_dir / "replay.png", run_dir / "orientation.png"
    replay_figure(frame, log, recording.bag.path.name, scan_source.robot.dt, replay)
    orientation_figure(scan_source, recording, orientation)
    return [replay, orientation]


def replay_figure(frame: pd.DataFrame, log: Log, name: str, period_s: float, path: Path) -> None:
    """Draw the driven path with scan points and subgoals, and velocities, clearances and decision times over time."""
    figure = new_figure(11.0, 6.6, layout=None)
    grid = figure.add_gridspec(
        4, 2, width_ratios=(1.2, 1), hspace=0.4, wspace=0.16, left=0.06, right=0.98, bottom=0.08, top=0.9
    )
    # Left: the map. Right: four quantities over time.
    _draw_path(figure.add_subplot(grid[:, 0]), frame, log)
    time = frame["time_s"].to_numpy()
    axes = [figure.add_subplot(grid[row, 1]) for row in range(4)]
    for axis, key, label in ((axes[0], "v_mps", "v [m/s]"), (axes[1], "omega_radps", "ω [rad/s]")):
        axis.plot(time, frame[key], color=RECORDED, linewidth=1.0, label="robot")
        axis.plot(time, frame[f"command_{key}"], color=PROPOSED, linewidth=0.8, label="proposed")
        axis.set_ylabel(label, fontsize=8)
    axes[2].plot(time, frame["recorded_clearance_m"], color=RECORDED, linewidth=1.0)
    axes[2].plot(time, frame["command_clearance_m"], color=PROPOSED, linewidth=0.8)
    axes[2].set_ylabel("clearance [m]", fontsize=8)
    axes[3].semilogy(time, frame["decision_us"] / 1e3, ".", color=INK, markersize=2)
    axes[3].axhline(period_s * 1e3, color=PROPOSED, linewidth=0.8, linestyle="--")
    axes[3].set_ylabel("decision [ms]", fontsize=8)
    axes[3].set_xlabel("time since the recording began [s]", fontsize=8)
    axes[3].text(time[0], period_s * 1e3, "control period", fontsize=7, color=PROPOSED, va="bottom")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), fontsize=7, frameon=False, ncols=2)
    for axis in axes:
        axis.tick_params(labelsize=7)
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle(name, fontsize=11, color=INK)
    save(figure, path.with_suffix(""))


def orientation_figure(scan_source: ScanSource, recording: Recording, path: Path) -> None:
    """Draw the first scan as the policy receives it, from above with the heading up.

    The picture shows whether left and right are swapped.
    """
    lidar = scan_source.robot.lidar
    scan = scan_source.read(recording.first_scan.content)
    points = obstacle_points(scan, lidar.mount)
    figure = new_figure(6.0, 6.4, layout=None)
    axes = figure.add_axes((0.08, 0.06, 0.84, 0.82))
    # Colour the points by the order of the beams, on a page with x up and y to the left.
    order = _beam_shares(points, scan_source)
    scatter = axes.scatter(-points[:, 1], points[:, 0], c=order, s=4, cmap="viridis", vmin=0, vmax=1)
    reach = min(_SEEN_M, 1.1 * float(np.abs(points).max(initial=1.0)))
    _draw_blind_arc(axes, scan_source, reach)
    _draw_robot(axes, scan_source)
    for x, y, text in ((0, 0.93, "FRONT"), (0, -0.96, "BACK"), (-0.88, 0, "LEFT"), (0.88, 0, "RIGHT")):
        axes.text(x * reach, y * reach, text, ha="center", va="center", fontsize=10, color=INK, weight="bold")
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="−y [m]", ylabel="x [m]")
    bar = figure.colorbar(scatter, ax=axes, orientation="horizontal", fraction=0.03, pad=0.08)
    bar.set_label("beam, first to last", fontsize=8)
    posture_text = ", upside down" if scan_source.upside_down else ""
    figure.suptitle(
        f"First scan in the base frame, from above{posture_text}\n{len(points)} returns of {lidar.num_beams} beams, "
        f"{math.degrees(lidar.fov):.0f}°; mount: {scan_source.mounted_by}",
        fontsize=9,
        color=INK,
    )
    save(figure, path.with_suffix(""))


def _draw_path(axes: Axes, frame: pd.DataFrame, log: Log) -> None:
    """Draw the map in the odometry frame: what the scans saw, the path, the subgoals and the goal, all in full."""
    path = frame[["x_m", "y_m"]].to_numpy()
    scan_points = np.concatenate(
        [np.empty((0, 2)), *(to_world(step.points, step.motion.pose) for step in log.sample)]
    )
    subgoals = np.array([to_world(step.subgoal, step.motion.pose) for step in log.sample])
    goal = to_world(log.sample[-1].target, log.sample[-1].motion.pose)
    axes.plot(*scan_points.T, ".", color=OBSTACLE, markersize=0.8, alpha=0.5, zorder=1)
    for step, subgoal in zip(log.sample, subgoals, strict=True):
        axes.plot(*zip(step.motion.pose[:2], subgoal, strict=True), color=PROPOSED, zorder=2, **_FADED)
        axes.plot(*subgoal, ".", color=PROPOSED, markersize=3, zorder=2)
    axes.plot(*path.T, color=RECORDED, linewidth=1.6, zorder=3, label="robot")
    start: dict[str, Any] = {"marker": pointer(frame["yaw_rad"].iloc[0]), "linestyle": "", "label": "start"}
    axes.plot(*path[0], markersize=13, color=INK, markeredgecolor="white", zorder=4, **start)
    axes.plot(*goal, "*", color=GOAL, markersize=12, zorder=5, label="goal")
    axes.plot([], [], color=PROPOSED, marker=".", label="to the subgoal", **_FADED)
    # Show everything, with a margin.
    everything = np.vstack([scan_points, path, subgoals, goal])
    low, high = everything.min(axis=0), everything.max(axis=0)
    (x0, y0), (x1, y1) = low - EDGE * (high - low).max() - EDGE_M, high + EDGE * (high - low).max() + EDGE_M
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    # In the corner, a flat map is still near the heading, and beside a narrow one there is room for the legend.
    axes.set(aspect="equal", anchor="NW")
    axes.set_xlabel("x in the odometry frame [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)


def _beam_shares(points: np.ndarray, scan_source: ScanSource) -> np.ndarray:
    """Return each point's beam as a share of the sweep, (M,): 0 for the first beam and 1 for the last."""
    lidar = scan_source.robot.lidar
    at_lidar = to_robot(points, lidar.mount)
    bearings = np.arctan2(at_lidar[:, 1], at_lidar[:, 0]) - lidar.angle_min
    return np.asarray(np.mod(bearings + 1e-6, math.tau) / lidar.fov)


def _draw_blind_arc(axes: Axes, scan_source: ScanSource, reach: float) -> None:
    from matplotlib.patches import Wedge

    lidar = scan_source.robot.lidar
    if lidar.full_circle:
        return
    middle = math.degrees(lidar.yaw) + 90.0  # since ahead is up on the page
    half = math.degrees(lidar.fov) / 2
    centre = (-lidar.y, lidar.x)
    blind = Wedge(centre, 2 * reach, middle + half, middle - half + 360, facecolor="#EEEEEE", zorder=0)
    axes.add_patch(blind)


def _draw_robot(axes: Axes, scan_source: ScanSource) -> None:
    from matplotlib.patches import FancyBboxPatch

    half_length, half_width, rounding = scan_source.robot.footprint.box
    style = f"round,pad={rounding},rounding_size={max(rounding, 1e-6)}" if rounding else "square,pad=0"
    corner = (-half_width, -half_length)
    size = (max(2 * half_width, 1e-6), max(2 * half_length, 1e-6))
    axes.add_patch(FancyBboxPatch(corner, *size, boxstyle=style, facecolor="none", edgecolor=INK))
    length = max(2 * scan_source.robot.footprint.circumscribed_radius, 0.3)
    axes.annotate("", xy=(0, length), xytext=(0, 0), arrowprops={"arrowstyle": "->", "color": INK})
    axes.plot(-scan_source.robot.lidar.y, scan_source.robot.lidar.x, "+", color=PROPOSED, markersize=6)


def check_rerun() -> None:
    """Raise InputError unless rerun-sdk, which writes the file, is installed."""
    try:
        import rerun  # noqa: F401
    except ImportError as error:
        raise InputError(f"rerun=true needs the package rerun-sdk: {install('rerun-sdk')}") from error


class RerunFile:
    """A file to which each decision is written as it is made, in the odometry frame and at its recorded time.

    Points and lines are 3D at height 0: rerun draws 2D ones with y downwards as in images, which swaps left and
    right.
    """

    def __init__(self, path: Path, name: str, robot: Robot) -> None:
        self.path = path
        self._name = name
        self._radius = robot.footprint.circumscribed_radius

    def __enter__(self) -> Self:
        check_rerun()
        import rerun

        self._rerun = rerun
        self._stream = rerun.RecordingStream("lme_replay")
        self._stream.save(self.path)
        self._stream.send_recording_name(self._name)
        self._stream.log("map", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._way: list[tuple[float, float]] = []
        return self

    def __exit__(self, *error: object) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def show(self, step: ReplayStep) -> None:
        """Add one step."""
        pose = step.motion.pose
        position = np.array(pose[:2])
        self._stream.set_time("recording", duration=step.time_s)
        self._points("scan", to_world(step.points, pose), 0.02, _GREY)
        self._points("robot", position[None], self._radius, _BLUE)
        self._points("subgoal", to_world(step.subgoal, pose)[None], 0.06, _ORANGE)
        self._points("goal", to_world(step.target, pose)[None], 0.08, _GREEN)
        arrow = to_world(np.array([2 * self._radius, 0.0]), pose) - position
        arrows = self._rerun.Arrows3D(
            origins=_flat(position[None]), vectors=_flat(arrow[None]), colors=[_BLUE]
        )
        self._stream.log("map/heading", arrows)
        self._way = [*self._way[-1:], (pose.x, pose.y)]
        self._stream.log("map/way", self._rerun.LineStrips3D([_flat(np.array(self._way))], colors=[_BLUE]))
        for name, robot, proposed in zip(("v", "omega"), step.motion.twist, step.command, strict=True):
            self._stream.log(f"{name}/robot", self._rerun.Scalars(robot))
            self._stream.log(f"{name}/proposed", self._rerun.Scalars(proposed))

    def _points(self, name: str, points: Floats, radius: float, colour: tuple[int, int, int]) -> None:
        markers = self._rerun.Points3D(_flat(points), radii=radius, colors=colour)
        self._stream.log(f"map/{name}", markers)


def _flat(points: Floats) -> Floats:
    """Return points (N, 2) as (N, 3) at height 0."""
    return np.column_stack([points, np.zeros(len(points))])
