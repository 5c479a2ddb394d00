"""Geometry of motion tubes: swept areas and the ranges that free beams must exceed."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme.planners.motion_tubes.kernels import Ranges, arc_pose, free_ranges, swept_ranges
from lme.types import Bools, Floats, Ints, LaserScan, Pose

Box = tuple[float, float, float]  # half_length, half_width, rounding [m]

_ALONG = 0.03  # [m] between placements of the outline along a tube
_CORNER_SIDES = 8  # of the polygon that approximates a rounded corner
_WHISKER_SAMPLES = 3
_LATTICE = 0.05  # [m] between samples behind the robot


class LidarView(NamedTuple):
    """Origin and directions of a scan's beams in the base frame; the increment is positive."""

    x: float  # [m]
    y: float  # [m]
    first: float  # [rad] bearing of the first beam
    increment: float  # [rad]
    num_beams: int


class TubeSpec(NamedTuple):
    """Specification of a set of tubes; equal specifications share one set."""

    length: float  # [m] distance driven by the base
    heading_max: float  # [rad] at the end of the most curved tube
    heading_step: float  # [rad]
    box: Box
    margins: tuple[float, float]  # [m] in front, at each side
    whiskers: tuple[float, float]  # [m] in front, at each side, beyond the margins


class Tubes(NamedTuple):
    """Tubes of one length for one lidar: the straight one first, then left and right alternately.

    curvatures (N,) [1/m]; needs (N, B) [m], spans (N, 2) and hidden (N,) as in `free_tubes` of `kernels.py`;
    whisker_beams and whisker_ranges (3, N, S): samples of the outer, front and inner whisker.
    """

    length: float
    curvatures: Floats
    needs: Ranges
    spans: Ints
    hidden: Bools
    whisker_beams: Ints
    whisker_ranges: Ranges


def lidar_view(scan: LaserScan, mount: Pose) -> tuple[LidarView, Ranges]:
    """Return the scan's beams in the base frame, anticlockwise, and the free range of each (B,) [m]."""
    free = free_ranges(scan.ranges, scan.range_min, scan.range_max)
    first, increment, count = scan.angle_min, scan.angle_increment, len(free)
    if increment < 0.0:
        first, increment, free = first + (count - 1) * increment, -increment, np.ascontiguousarray(free[::-1])
    return LidarView(mount.x, mount.y, mount.yaw + first, increment, count), free


@lru_cache(maxsize=16)
def forward_tubes(spec: TubeSpec, view: LidarView) -> Tubes:
    """Return the forward tubes."""
    curvatures = _curvatures(spec)
    outline = grown_outline(spec.box, *spec.margins)
    front = spec.box[0] + spec.box[2] + spec.margins[0]
    steps = max(1, math.ceil(spec.length / _ALONG))
    lidar = (view.x, view.y, view.first)
    needed, hidden = swept_ranges(
        curvatures, spec.length, steps, outline, front, lidar, view.increment, view.num_beams
    )
    beams, ranges = _whiskers(spec, curvatures, view)
    return Tubes(spec.length, curvatures, needed, _spans(needed), hidden, beams, ranges)


def grown_outline(box: Box, front: float, side: float) -> Floats:
    """Grow the footprint at front and sides; corners are circumscribed and anticlockwise: (V, 2) [m]."""
    half_length, half_width, rounding = box
    turns = np.array([0.0])
    if rounding > 0.0:
        turns = np.linspace(0.0, 0.5 * math.pi, _CORNER_SIDES + 1)
        rounding /= math.cos(0.25 * math.pi / _CORNER_SIDES)
    x, y = half_length + front, half_width + side
    middles = ((x, y), (-half_length, y), (-half_length, -y), (x, -y))
    parts = [
        np.array(middle) + rounding * np.column_stack((np.cos(turns + start), np.sin(turns + start)))
        for middle, start in zip(middles, 0.5 * math.pi * np.arange(4), strict=True)
    ]
    return np.vstack(parts)


def _curvatures(spec: TubeSpec) -> Floats:
    """Curvatures: 0, then left and right alternately, rising: (N,) [1/m]."""
    count = max(1, math.floor(spec.heading_max / spec.heading_step + 1e-9))
    left = spec.heading_step * np.arange(1, count + 1) / spec.length
    return np.concatenate(([0.0], np.column_stack((left, -left)).ravel()))


def _spans(needed: Ranges) -> Ints:
    """First and last beam that meet each tube: (N, 2); (0, −1) if none does."""
    is_met = np.pad(needed > 0.0, ((0, 0), (1, 1)))
    first_beam, last_beam = is_met.argmax(axis=1) - 1, needed.shape[1] - is_met[:, ::-1].argmax(axis=1)
    return np.where(np.any(is_met, axis=1, keepdims=True), np.column_stack((first_beam, last_beam)), (0, -1))


def _whiskers(spec: TubeSpec, curvatures: Floats, view: LidarView) -> tuple[Ints, Ranges]:
    """Samples of the whiskers at the end of each tube, (3, N, S); a straight tube's outer and inner are equal."""
    half_length, half_width, rounding = spec.box
    x, y = half_length + spec.margins[0], half_width + spec.margins[1]
    across = y + rounding + spec.whiskers[1] * np.arange(1, _WHISKER_SAMPLES + 1) / _WHISKER_SAMPLES
    left = np.column_stack((np.full(_WHISKER_SAMPLES, x), across))
    ahead = np.full(_WHISKER_SAMPLES, x + rounding + spec.whiskers[0])
    front = np.column_stack((ahead, np.linspace(-y, y, _WHISKER_SAMPLES)))
    right = left * (1.0, -1.0)
    both_sides, empty = np.vstack((left, right)), np.empty((0, 2))
    sides = {0.0: (both_sides, empty), 1.0: (right, left), -1.0: (left, right)}
    samples = np.empty((3, len(curvatures), 2 * _WHISKER_SAMPLES, 2))
    for n, curvature in enumerate(curvatures):
        outer, inner = sides[float(np.sign(curvature))]
        pose = arc_pose(curvature, spec.length)
        for k, whisker in enumerate((outer, front, inner if len(inner) else both_sides)):
            samples[k, n] = np.resize(_placed(whisker, pose), (2 * _WHISKER_SAMPLES, 2))
    return _beams(samples, view)


def _placed(points: Floats, pose: tuple[float, float, float]) -> Floats:
    """Transform points (..., 2) from the frame at `pose` to its parent frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = points[..., 0], points[..., 1]
    return np.stack((pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y), axis=-1)


def _beams(points: Floats, view: LidarView) -> tuple[Ints, Ranges]:
    """Return the beam nearest to each point (..., 2), −1 if out of view, and the point's range [m]."""
    dx, dy = points[..., 0] - view.x, points[..., 1] - view.y
    bearings = ((np.arctan2(dy, dx) - view.first) % math.tau) / view.increment
    beams = np.where(bearings >= math.tau / view.increment - 0.5, 0, np.rint(bearings))
    beams = np.where(beams < view.num_beams, beams, -1)
    return beams.astype(np.int64), np.hypot(dx, dy).astype(np.float32)


class BackwardTubes(NamedTuple):
    """Tubes behind the robot, from the greatest curvature to the least.

    curvatures (N,) [1/m]; ends (N, 2) of the base [m]; samples (P, 2) [m]; inside (N, P): whether a tube contains a
    sample.
    """

    curvatures: Floats
    ends: Floats
    samples: Floats
    inside: Bools


@lru_cache(maxsize=16)
def backward_tubes(spec: TubeSpec) -> BackwardTubes:
    """Return the tubes driven backwards, with the front margin at the rear and without whiskers."""
    curvatures = np.sort(_curvatures(spec))
    half_length, half_width, rounding = spec.box
    grown = (half_length + spec.margins[0], half_width + spec.margins[1], rounding)
    reach = spec.length + math.hypot(*grown[:2]) + rounding
    ticks = _LATTICE * np.arange(-math.ceil(reach / _LATTICE), math.ceil(reach / _LATTICE) + 1)
    lattice = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    lattice = lattice[~_within(lattice, grown, (0.0, 0.0, 0.0))]
    inside = np.zeros((len(curvatures), len(lattice)), np.bool_)
    steps = max(1, math.ceil(spec.length / _LATTICE))
    for n, curvature in enumerate(curvatures):
        for k in range(1, steps + 1):
            inside[n] |= _within(lattice, grown, arc_pose(curvature, -spec.length * k / steps))
    is_covered = inside.any(axis=0)
    ends = np.array([arc_pose(curvature, -spec.length)[:2] for curvature in curvatures])
    return BackwardTubes(curvatures, ends, lattice[is_covered], np.ascontiguousarray(inside[:, is_covered]))


def _within(points: Floats, box: Box, pose: tuple[float, float, float]) -> Bools:
    """Return whether each of the points (P, 2) lies in the rounded rectangle at `pose`: (P,)."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    beside_x = np.maximum(np.abs(cos * dx + sin * dy) - box[0], 0.0)
    beside_y = np.maximum(np.abs(cos * dy - sin * dx) - box[1], 0.0)
    is_inside: Bools = np.hypot(beside_x, beside_y) <= box[2] + 1e-9
    return is_inside
