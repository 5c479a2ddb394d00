"""The results of a replay: its table, and figures of agreement and decision time, from the log alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.live.messages import SECOND
from lme.types import Floats
from runners.config.escaping import counted
from runners.recordings.driver import Log
from runners.records.atomic_write import replacing, write_atomically

if TYPE_CHECKING:
    import pandas as pd

TABLE = "replay.parquet"
FIGURES = "agreement.json"
_MOVING = 0.02  # [m/s] a slower robot counts as standing still
_TURNING = 0.1  # [rad/s] a slower robot counts as not turning
_CLOSE = math.radians(30.0)  # [rad] headings that differ by less agree


def replay_table(log: Log, period_s: float, ahead: float) -> pd.DataFrame:
    """Return the table of a replay: the rows of the log, and what the robot did.

    recorded_command_*: the next command recorded within a period, else the previous one. robot_heading_rad: bearing
    of the position where the robot was first `ahead` [m] away. heading_error_rad: bearing of the subgoal minus
    robot_heading_rad. Both are NaN if the robot did not get that far.
    """
    import pandas as pd

    frame = pd.DataFrame(log.rows)
    stamps = frame["stamp_ns"].to_numpy()
    frame[["recorded_command_v_mps", "recorded_command_omega_radps"]] = _recorded_commands(
        log, stamps, period_s
    )
    headings = headings_ahead(frame[["x_m", "y_m", "yaw_rad"]].to_numpy(), ahead)
    bearings = np.arctan2(frame["subgoal_y_m"].to_numpy(), frame["subgoal_x_m"].to_numpy())
    frame["robot_heading_rad"] = headings
    frame["heading_error_rad"] = (bearings - headings + np.pi) % (2 * np.pi) - np.pi
    return frame


def headings_ahead(poses: Floats, ahead: float) -> Floats:
    """Return the bearing [rad] from each pose (T, 3) to the next at least `ahead` [m] away, (T,); NaN without one."""
    bearings = np.full(len(poses), np.nan)
    j = 0
    # The later position only moves forward, so the search takes linear time.
    for k, (x, y, yaw) in enumerate(poses):
        j = max(j, k)
        while j < len(poses) and math.hypot(poses[j, 0] - x, poses[j, 1] - y) < ahead:
            j += 1
        if j == len(poses):
            break
        bearing = math.atan2(poses[j, 1] - y, poses[j, 0] - x) - yaw
        bearings[k] = math.remainder(bearing, math.tau)
    return bearings


def figures(frame: pd.DataFrame, log: Log, period_s: float, wall_s: float) -> dict[str, float]:
    """Return agreement with the robot, clearance, and decision time. Names give the units; shares are from 0 to 1."""
    # Proposed minus recorded, at each decision.
    heading = frame["heading_error_rad"].abs().dropna().to_numpy()
    speed = (frame["command_v_mps"] - frame["v_mps"]).to_numpy()
    turn = (frame["command_omega_radps"] - frame["omega_radps"]).to_numpy()
    duration = float(frame["time_s"].iloc[-1] - frame["time_s"].iloc[0])
    return {
        "ticks": len(frame),
        "scans": log.scans,
        **asdict(log.tally),
        **{f"skipped_{key.replace(' ', '_')}": count for key, count in log.skipped.items()},
        "duration_s": duration,
        "heading_error_median_deg": _median(np.degrees(heading)),
        "heading_within_30deg": _mean(heading < _CLOSE),
        "speed_error_mean_mps": _mean(speed),
        "speed_error_abs_mean_mps": _mean(np.abs(speed)),
        "turn_error_abs_mean_radps": _mean(np.abs(turn)),
        "turn_same_way": _same_way(frame),
        "same_command": _same_command(frame),
        "robot_moving": _mean(frame["v_mps"].abs().to_numpy() > _MOVING),
        "blocked": _mean(frame["blocked"].to_numpy()),
        "switches": int(frame["switched"].sum()),
        **_clearances(frame),
        **_times(frame["decision_us"].to_numpy(), period_s),
        "times_real_time": duration / wall_s if wall_s > 0.0 else math.nan,
    }


def lines(results: Mapping[str, float], ahead: float) -> list[str]:
    """Return the figures as a few lines of text. ahead: as for `replay_table` [m]."""
    decisions = f"{counted(int(results['ticks']), 'decision')} over {results['duration_s']:.1f} s"
    skipped = int(results["skipped_no_pose"] + results["skipped_no_goal"])
    left_out = f", {counted(skipped, 'tick')} left out" if skipped else ""
    return [
        f"{decisions}{left_out}, {results['times_real_time']:.0f} × real time",
        _heading(results, ahead),
        f"speed    {results['speed_error_mean_mps']:+.2f} m/s against the robot's, "
        f"{results['speed_error_abs_mean_mps']:.2f} m/s apart on average",
        f"clearance of the command {results['command_clearance_p05_m']:.2f} m (5th percentile), of the robot's motion "
        f"{results['recorded_clearance_p05_m']:.2f} m; into contact in {_percent(results['command_contact'])} "
        f"and {_percent(results['recorded_contact'])}",
        f"decision {results['decision_ms_p50']:.2f} ms (p50), {results['decision_ms_p99']:.2f} ms (p99); "
        f"{results['missed_deadlines']:.0f} of {results['ticks']:.0f} missed the period",
        f"scans    {results['beams_without_return']:.0f} of {results['beams']:.0f} beams without return, "
        f"{counted(int(results['scans_without_point']), 'scan')} without a point",
    ]


def _heading(results: Mapping[str, float], ahead: float) -> str:
    """Return the line about headings and turns, as far as the robot drove and turned."""
    if math.isnan(results["heading_error_median_deg"]):
        return f"heading  not compared: the robot never got {ahead:g} m (ahead) away from where a decision was made"
    turns = results["turn_same_way"]
    same_way = "" if math.isnan(turns) else f", turning the same way in {_percent(turns)}"
    return (
        f"heading  off the robot's by {results['heading_error_median_deg']:.0f}° (median), "
        f"within 30° in {_percent(results['heading_within_30deg'])}{same_way}"
    )


def write(frame: pd.DataFrame, results: Mapping[str, float], run_dir: Path) -> list[Path]:
    """Write the table and the figures; return their paths."""
    import json

    table, numbers = run_dir / TABLE, run_dir / FIGURES
    with replacing(table) as draft:
        frame.to_parquet(draft, index=False)
    finite = {key: value if math.isfinite(value) else None for key, value in results.items()}
    write_atomically(numbers, json.dumps(finite, indent=1) + "\n")
    return [table, numbers]


def _recorded_commands(log: Log, stamps: Floats, period_s: float) -> Floats:
    """Return the recorded commands (T, 2) [m/s, rad/s], one for each tick; NaN if there is none."""
    if not log.commands:
        return np.full((len(stamps), 2), np.nan)
    commands = sorted(log.commands)
    times = np.array([stamp for stamp, _, _ in commands])
    values = np.array([[v, omega] for _, v, omega in commands])
    # The next command counts if it comes within a period of the tick, else the previous one.
    indices = np.searchsorted(times, stamps, side="left")
    timely = times[np.minimum(indices, len(times) - 1)] < stamps + round(period_s * SECOND)
    used_indices = np.where((indices < len(times)) & timely, indices, indices - 1)
    return np.where((used_indices >= 0)[:, None], values[np.maximum(used_indices, 0)], np.nan)


def _clearances(frame: pd.DataFrame) -> dict[str, float]:
    values_by_name = {}
    for whose in ("command", "recorded"):
        values = frame[f"{whose}_clearance_m"].to_numpy()
        values_by_name[f"{whose}_clearance_p05_m"] = float(np.percentile(values, 5, method="lower"))
        values_by_name[f"{whose}_contact"] = _mean(values <= 0.0)
    return values_by_name


def _times(decision_us: Floats, period_s: float) -> dict[str, float]:
    return {
        "decision_ms_p50": float(np.percentile(decision_us, 50)) / 1e3,
        "decision_ms_p99": float(np.percentile(decision_us, 99)) / 1e3,
        "decision_ms_max": float(decision_us.max()) / 1e3,
        "missed_deadlines": int((decision_us > period_s * 1e6).sum()),
    }


def _same_way(frame: pd.DataFrame) -> float:
    """Return the share of ticks at which both turn in the same direction, among those at which both turn."""
    omega, recorded_omega = frame["command_omega_radps"].to_numpy(), frame["omega_radps"].to_numpy()
    are_turning = (np.abs(omega) > _TURNING) & (np.abs(recorded_omega) > _TURNING)
    return _mean(np.sign(omega[are_turning]) == np.sign(recorded_omega[are_turning]))


def _same_command(frame: pd.DataFrame) -> float:
    """Return the share of ticks whose command equals the recorded one to the last bit."""
    v = frame["command_v_mps"].to_numpy() == frame["recorded_command_v_mps"].to_numpy()
    omega = frame["command_omega_radps"].to_numpy() == frame["recorded_command_omega_radps"].to_numpy()
    return _mean(v & omega)


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def _median(values: Floats) -> float:
    return float(np.median(values)) if len(values) else math.nan


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
