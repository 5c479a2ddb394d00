"""Times each kernel, called from Python, against its plain twin and, for the scan, pymunk's ray queries."""

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pymunk

from lme.config.presets import load_settings
from lme.geometry.collision import sweep
from lme.geometry.fan import fan_blocked
from lme.guides.lme.surmount import cluster
from lme.perception.raycast import cast_shapes
from lme.perception.scan_points import beam_directions, scan_points
from lme.types import Pose
from lme.worlds.barn.map_set import Barn
from tests import oracles

FULL_CIRCLE = (-math.pi, 2 * math.pi / 540, 540)
RANGE_MAX = 15.0
RADIUS = 0.261
LIDAR = Pose(-2.25, 3.0, math.pi / 2)
TARGET = np.array([10.0, 0.0])
MOUNT = Pose(0.0, 0.0, 0.0)
NO_EDGES = np.empty((0, 4))


def measure(function: Callable[[], object], seconds: float = 0.4) -> tuple[float, float]:
    """Least and median time of one call [µs], measured for `seconds`."""
    function()
    start = time.perf_counter()
    function()
    calls = max(1, int(2e-3 / (time.perf_counter() - start)))
    times: list[float] = []
    begin = time.perf_counter()
    while len(times) < 5 or time.perf_counter() - begin < seconds:
        start = time.perf_counter()
        for _ in range(calls):
            function()
        times.append((time.perf_counter() - start) / calls * 1e6)
    return min(times), float(np.median(times))


def pymunk_scan(circles: np.ndarray) -> Callable[[], list[object]]:
    """A function that makes one scan, with a ray query for each beam."""
    space = pymunk.Space()
    for x, y, r in circles:
        space.add(pymunk.Circle(space.static_body, r, (x, y)))
    bearings = LIDAR.yaw + FULL_CIRCLE[0] + FULL_CIRCLE[1] * np.arange(FULL_CIRCLE[2])
    start = (LIDAR.x, LIDAR.y)
    ends = [(LIDAR.x + RANGE_MAX * math.cos(b), LIDAR.y + RANGE_MAX * math.sin(b)) for b in bearings]
    accept = pymunk.ShapeFilter()
    return lambda: [space.segment_query_first(start, end, 0.0, accept) for end in ends]


def candidates(count: int = 302) -> np.ndarray:
    """Points (count, 2) [m], uniform in range up to 5 m and in bearing."""
    rng = np.random.default_rng(0)
    reach, bearing = rng.uniform(0, 5, count), rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing)])


def rows(circles: np.ndarray) -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    """Each kernel and its twin on the same scene."""
    directions = beam_directions(*FULL_CIRCLE)
    ranges = cast_shapes(LIDAR, FULL_CIRCLE, RANGE_MAX, circles, NO_EDGES)
    points = scan_points(ranges, directions, 0.02, RANGE_MAX, MOUNT)
    ends, origin = candidates(), np.zeros(2)
    ahead = np.linspace(0.025, 0.2, 8)
    poses = np.column_stack([np.full(8, LIDAR.x), LIDAR.y + ahead, np.full(8, LIDAR.yaw)])
    calls: dict[str, tuple[Callable[..., object], Callable[..., object], tuple[Any, ...]]] = {
        "cast": (cast_shapes, oracles.cast, (LIDAR, FULL_CIRCLE, RANGE_MAX, circles, NO_EDGES)),
        "scan_points": (
            scan_points,
            oracles.scan_points,
            (ranges, directions, 0.02, RANGE_MAX, MOUNT),
        ),
        "fan from robot": (fan_blocked, oracles.fan_blocked, (origin, ends, points, RADIUS)),
        "fan from target": (fan_blocked, oracles.fan_blocked, (TARGET, ends, points, RADIUS)),
        "cluster": (cluster, oracles.cluster, (points, 2 * RADIUS, True)),
        "sweep": (sweep, oracles.sweep, (poses, (0.21, 0.155, 0.0), circles, NO_EDGES)),
    }
    return {name: (partial(fast, *args), partial(slow, *args)) for name, (fast, slow, args) in calls.items()}


def kernel_rows() -> Iterator[str]:
    """Yield rows of a Markdown table: least and median, the twin, and for the scan pymunk's ray queries."""
    barn = Barn(load_settings("map/barn", subset="all"))
    for number in (0, 200):
        circles = barn.task(number).world.circles
        for kernel, (fast, slow) in rows(circles).items():
            minimum, median = measure(fast)
            twin = measure(slow)[1]
            cells = [f"world {number}, {len(circles)} cylinders", kernel, f"{minimum:.1f}", f"{median:.1f}"]
            cells += [f"{twin:,.0f}", f"{twin / median:,.0f}"]
            rays = measure(pymunk_scan(circles))[1] if kernel == "cast" else None
            cells += [f"{rays:,.0f}", f"{rays / median:,.0f}"] if rays else ["", ""]
            yield f"| {' | '.join(cells)} |"
