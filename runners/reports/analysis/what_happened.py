"""What happened in an episode, in one sentence, and how bad its end was.

The sentence says how the episode ended and, if the robot lost much time in one way, how: it stood, turned on the spot,
moved back and forth, circled or paced. Everything is taken from the episode's record and its control steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lme.live.step import LiveState
from lme.navigation.episode import TRAJECTORY_COLUMNS
from lme.simulation.contact_side import SIDES
from lme.simulation.simulator import FALL
from lme.types import Bools, Floats, Outcome

ORDER = (
    "Worst first: collisions by the speed at contact, then falls, then time-outs by the distance to the goal."
)
# Diagonals of the box in which a robot stays in place, and in which it paces. ASSUMED: a robot's size, a room's.
UP_TO_M = (0.5, 3.0)
# Longer than a careful turn in a gap; long enough for a slow robot (0.2 m/s) to leave a room.
IN_PLACE_S, PACING_S = 10.0, 30.0
# Slower counts as standing: about the noise of wheels and gaits.
STANDS_MPS, STANDS_RADPS = 0.05, 0.1
# A subgoal jumps if its bearing changes by so much at once; one nearer than a robot's radius has no telling bearing.
JUMP_RAD, JUMP_M = math.radians(60.0), 0.3
# Jumps explain lost time if they are as many and, on average, as frequent.
LEAST_JUMPS, JUMPS_EVERY_S = 3, 10.0
TIGHT_M = 0.1  # [m] with less space around it, a robot can hardly turn
BRAKED_MPS = 0.1  # [m/s] of speed lost within the last second that count as braking
ALIKE = 0.9  # [-] least length of the mean of unit vectors that counts as one direction: about ±25°
_MOSTLY = 0.5  # share of the steps, or of the turning in one direction


class Account(NamedTuple):
    """What happened in an episode. rank: sorts episodes worst first."""

    rank: tuple[int, float]
    sentence: str


class _Drive(NamedTuple):
    """Columns of the control steps, (T,) each or (T, 2), with the duration of each step [s]."""

    duration: Floats
    position: Floats
    yaw: Floats
    v: Floats
    omega: Floats
    subgoal: Floats
    clearance: Floats


def what_happened(record: Mapping[str, Any], trajectory: Floats) -> Account:
    """Return the account of an episode.

    record: a row of `episodes.parquet`, of which older ones may lack columns. trajectory: (T, 10) its control steps,
    columns TRAJECTORY_COLUMNS; T may be 0.
    """
    drive = _drive(trajectory)
    outcome, part = record["outcome"], str(record.get("contact_part") or "")
    is_fall = outcome == Outcome.COLLISION and part == FALL
    distance = float(record.get("final_distance_m", math.nan))
    lost, cause = _lost_time(record, drive)
    where = "" if math.isnan(distance) else f", {distance:.1f} m from the goal"
    before = f"; before, it {lost}{cause}" if lost else ""
    # Speeds and distances that are not known count as 0.
    if outcome == Outcome.COLLISION:
        speed = abs(float(drive.v[-1])) if len(drive.v) else 0.0
        end = f"fell at {speed:.2f} m/s" if is_fall else _collision(record, drive, part)
        return Account((1 if is_fall else 0, -speed), f"{end}{where}{before}")
    # A drive that is not an episode of an evaluation may have been cancelled.
    has_arrived = outcome in (Outcome.SUCCESS, LiveState.ARRIVED)
    driven = f"{record.get('path_length_m', math.nan):.1f} m"
    if record.get("shortest_path_length_m", 0.0) > 0.0:
        # Whoever arrives may stop short of the goal, by its tolerance.
        ratio = max(record["path_length_m"] / record["shortest_path_length_m"], 1.0 if has_arrived else 0.0)
        driven = f"{driven}, {ratio:.1f} times the shortest way"
    if outcome == Outcome.TIMEOUT:
        state = "was still on its way" if len(drive.v) else "did not arrive in time"
        end = f"{lost}{where}{cause}" if lost else f"{state}{where}, after {driven}"
        return Account((2, -float(np.nan_to_num(distance))), end)
    end = f"reached the goal after {driven}" if has_arrived else f"drove {driven}{where}"
    return Account((3, 0.0), f"{end}{before}")


def _drive(trajectory: Floats) -> _Drive:
    columns = dict(
        zip(TRAJECTORY_COLUMNS, np.asarray(trajectory, dtype=float).reshape(-1, 10).T, strict=True)
    )
    return _Drive(
        duration=np.diff(columns["time_s"], append=columns["time_s"][-1:]),
        position=np.column_stack((columns["x_m"], columns["y_m"])),
        yaw=columns["yaw_rad"],
        v=columns["v_mps"],
        omega=columns["omega_radps"],
        subgoal=np.column_stack((columns["subgoal_x_m"], columns["subgoal_y_m"])),
        clearance=columns["clearance_m"],
    )


def _collision(record: Mapping[str, Any], drive: _Drive, part: str) -> str:
    """Say what the robot did as it touched something, with which part, and whether it braked."""
    with_part = f" with {'its' if part in (*SIDES, 'trunk') else 'a'} {part}" if part else ""
    is_person = (
        record.get("robot_on_person_collision") == 1.0 or record.get("person_on_robot_collision") == 1.0
    )
    thing = "a person" if is_person else "an obstacle"
    if not len(drive.v):
        return f"hit {thing}{with_part}"
    v, omega = float(drive.v[-1]), float(drive.omega[-1])
    stands = abs(v) < STANDS_MPS and abs(omega) < STANDS_RADPS
    if record.get("person_on_robot_collision") == 1.0 or stands:
        mover, side = (
            "a person" if is_person else "something that moves",
            f" at its {part}" if part in SIDES else "",
        )
        return f"was run into by {mover}{side} while it {'stood' if stands else f'drove at {abs(v):.2f} m/s'}"
    if abs(v) < STANDS_MPS:
        return f"turned into {thing}{with_part} at {abs(omega):.1f} rad/s"
    # The greatest speed in the last second, against that at contact.
    recent = np.cumsum(drive.duration[::-1])[::-1] <= 1.0
    lost = float(np.abs(drive.v[recent]).max()) - abs(v)
    braking = f", braking from {abs(v) + lost:.2f} m/s" if lost >= BRAKED_MPS else ", without braking"
    return f"{'drove' if v > 0.0 else 'backed'} into {thing}{with_part} at {abs(v):.2f} m/s{braking}"


def _lost_time(record: Mapping[str, Any], drive: _Drive) -> tuple[str, str]:
    """Say in which way the robot lost the most time and for how long, and why; two times "" if in none."""
    in_place = _stays(drive, UP_TO_M[0], IN_PLACE_S)
    pacing = _stays(drive, UP_TO_M[1], PACING_S) & ~in_place
    times = [float(drive.duration[steps].sum()) for steps in (in_place, pacing)]
    if max(times) == 0.0:
        return "", ""
    steps, duration = (in_place, times[0]) if times[0] >= times[1] else (pacing, times[1])
    action = _in_place(drive, steps) if steps is in_place else _pacing(drive, steps)
    return f"{action} for {duration:.0f} s", _cause(record, drive, steps, duration)


def _stays(drive: _Drive, extent_m: float, seconds: float) -> Bools:
    """Return the steps within any stretch of `seconds` in which the robot stays in a box of this diagonal: (T,)."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    if float(drive.duration.sum()) < seconds:
        return np.zeros(len(drive.v), bool)
    size = (
        math.ceil(seconds / float(np.median(drive.duration[:-1]))) | 1
    )  # steps, odd, so that it has a middle
    low, high = (
        extreme(drive.position, size, axis=0, mode="nearest")
        for extreme in (minimum_filter1d, maximum_filter1d)
    )
    stays = (np.hypot(*(high - low).T) <= extent_m).astype(np.int8)
    stays[: size // 2] = stays[len(stays) - size // 2 :] = 0  # the stretch around them is cut off
    return maximum_filter1d(stays, size, mode="constant").astype(bool)


def _in_place(drive: _Drive, steps: Bools) -> str:
    moves, turns = np.abs(drive.v[steps]) >= STANDS_MPS, np.abs(drive.omega[steps]) >= STANDS_RADPS
    if moves.mean() >= _MOSTLY:
        return f"moved back and forth within {UP_TO_M[0]:g} m"
    return "turned on the spot" if turns.mean() >= _MOSTLY else "stood"


def _pacing(drive: _Drive, steps: Bools) -> str:
    turning = (np.diff(np.unwrap(drive.yaw), append=drive.yaw[-1:]) * steps)[:-1]
    rounds = abs(float(turning.sum())) / (2.0 * math.pi)
    circles = rounds >= 2.0 and abs(turning.sum()) >= _MOSTLY * np.abs(turning).sum()
    return f"drove {f'in {rounds:.0f} circles' if circles else 'to and fro'} within {UP_TO_M[1]:g} m"


def _cause(record: Mapping[str, Any], drive: _Drive, steps: Bools, duration: float) -> str:
    """Name the first of: a subgoal that jumps, no free way, little space; else say where the subgoal was."""
    # The subgoal before and after each jump, both from the pose at the jump.
    bearings, distances = _from_robot(drive, drive.subgoal)
    former_bearings, former_distances = _from_robot(drive, np.roll(drive.subgoal, 1, axis=0))
    far = (distances >= JUMP_M) & (former_distances >= JUMP_M)
    jumps = steps & far & (np.abs(_wrapped(bearings - former_bearings)) >= JUMP_RAD)
    jumps[:1] = False
    count = int(jumps.sum())
    if count >= max(LEAST_JUMPS, duration / JUMPS_EVERY_S):
        pairs = np.sort(np.column_stack((former_bearings, bearings))[jumps], axis=1)
        right, left = np.median(pairs, axis=0)
        return f": the subgoal jumped {count} times between {_direction(left)} and {_direction(right)}"
    blocked, decisions = record.get("no_free_candidate", 0), record.get("steps", 0)
    if blocked and blocked >= _MOSTLY * decisions:
        return f": the guide had no free way at {blocked} of {decisions} decisions"
    space = float(np.median(drive.clearance[steps]))
    if space < TIGHT_M:
        return f", with {space:.2f} m to the nearest obstacle"
    known = steps & np.isfinite(distances)
    if not known.any() or np.median(distances[known]) < JUMP_M:
        return ""
    # Their mean as directions, which is short if they differ.
    mean = np.exp(1j * bearings[known]).mean()
    direction = f", {_direction(float(np.angle(mean)))}" if abs(mean) >= ALIKE else ""
    return f", with the subgoal {np.median(distances[known]):.1f} m away{direction}"


def _from_robot(drive: _Drive, points: Floats) -> tuple[Floats, Floats]:
    """Return the bearing [rad] and the distance [m], (T,) each, of a point (T, 2) at each step; NaN if it is NaN."""
    offset = points - drive.position
    return _wrapped(np.arctan2(offset[:, 1], offset[:, 0]) - drive.yaw), np.hypot(*offset.T)


def _wrapped(angles: Floats) -> Floats:
    return (angles + math.pi) % (2.0 * math.pi) - math.pi


def _direction(bearing: float) -> str:
    degrees = round(math.degrees(bearing))
    return (
        "straight ahead" if degrees == 0 else f"{abs(degrees)}° to the {'left' if degrees > 0 else 'right'}"
    )
