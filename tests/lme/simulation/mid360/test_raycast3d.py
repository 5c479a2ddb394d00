import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.perception.raycast import cast_shapes
from lme.simulation.mid360.raycast3d import cast_rays
from lme.simulation.mid360.sensor import ExtrudedWorld
from lme.worlds.world import World
from tests.tolerances import KERNEL, RANGE

SEEDS = st.integers(0, 2**32 - 1)


def obvious_cast(origin, direction, scene, range_max):
    """One ray against every surface in turn: pillars, walls, lids, floors."""
    hits = [np.inf]
    world = scene.world
    x, y, z = origin
    dx, dy, dz = direction
    for (cx, cy, r), (bottom, top) in zip(world.circles, scene.circles, strict=True):
        if math.hypot(x - cx, y - cy) <= r and bottom <= z <= top:
            hits.append(0.0)
        polynomial = [
            dx * dx + dy * dy,
            2 * (dx * (x - cx) + dy * (y - cy)),
            (x - cx) ** 2 + (y - cy) ** 2 - r * r,
        ]
        for root in np.roots(polynomial):
            if abs(root.imag) == 0 and root.real >= 0 and bottom <= z + root.real * dz <= top:
                hits.append(root.real)
        for height in (bottom, top):
            t = (height - z) / dz
            if t >= 0 and math.hypot(x + t * dx - cx, y + t * dy - cy) <= r:
                hits.append(t)
    rings = [np.array([[x0, y0], [x1, y1]]) for x0, y0, x1, y1 in world.segments]
    spans = [*scene.segments, *scene.polygons]
    for ring, (bottom, top) in zip([*rings, *world.polygons], spans, strict=True):
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            t, share = np.linalg.solve(np.array([[dx, a[0] - b[0]], [dy, a[1] - b[1]]]), a - [x, y])
            if t >= 0 and 0 <= share <= 1 and bottom <= z + t * dz <= top:
                hits.append(t)
        for height in (bottom, top):
            t = (height - z) / dz
            if t >= 0 and len(ring) > 2 and winds(ring - [x + t * dx, y + t * dy]):
                hits.append(t)
    for height in (scene.ground, scene.ceiling):
        hits.append((height - z) / dz if (height - z) / dz > 0 else np.inf)
    return min(hits) if min(hits) <= range_max else np.inf


def winds(ring):
    """Whether a ring (V, 2) goes round the origin."""
    turns = np.diff(np.unwrap(np.arctan2(*np.vstack([ring, ring[:1]]).T[::-1])))
    return abs(turns.sum()) > math.pi


def spans(rng, count):
    return np.sort(rng.uniform(-0.2, 2.0, (count, 2)), axis=1)


def furnished(seed):
    """A few things of any height, and a point outside the polygons to look from."""
    rng = np.random.default_rng(seed)
    boxes = []
    for x, y in ((-3, -3), (3, -3), (3, 3), (-3, 3))[: rng.integers(0, 5)]:
        size, angle = rng.uniform(0.2, 1.5), rng.uniform(0, 7)
        corners = np.array([[1, 0], [0, 1], [-0.3, 0], [0, -1]])  # a dart: not convex
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        boxes.append(corners @ turn.T * size + [x, y])
    circles = np.column_stack([rng.uniform(-4, 4, (5, 2)), rng.uniform(0.05, 0.8, 5)])[: rng.integers(0, 6)]
    world = World(
        circles=circles, segments=rng.uniform(-4, 4, (rng.integers(0, 5), 4)), polygons=tuple(boxes)
    )
    scene = ExtrudedWorld(
        world,
        circles=spans(rng, len(circles)),
        segments=spans(rng, len(world.segments)),
        polygons=spans(rng, len(boxes)),
        ground=rng.choice([-0.3, -math.inf]),
        ceiling=rng.choice([2.1, math.inf]),
    )
    return scene, np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(0.0, 2.0)]), rng


@given(SEEDS)
def test_rays_equal_every_ray_against_every_surface(seed):
    scene, origin, rng = furnished(seed)
    directions = rng.normal(size=(40, 3)) * [1, 1, 0.3]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    range_max = rng.uniform(1, 12)
    distances = cast_rays(origin, directions, *scene.obstacles(), (scene.ground, scene.ceiling), range_max)
    expected = [obvious_cast(origin, direction, scene, range_max) for direction in directions]
    assert distances == pytest.approx(expected, abs=RANGE)


BOX = np.array([[1.75, -0.25], [2.25, -0.25], [2.25, 0.25], [1.75, 0.25]])


@pytest.mark.parametrize(
    ("direction", "distance"),
    [((0, 0, 1), 1.1), ((0, 0, -1), 0.4), ((1, 0, 0), 1.75), ((0, 1, 0), math.inf), ((-1, 0, 0), 1.7)],
)
def test_rays_along_the_axes(direction, distance):
    # Under a lamp 1.5 m up, a box ahead and a pillar beyond it, a pillar behind.
    world = World(circles=np.array([[0.0, 0.0, 0.3], [-2.0, 0.0, 0.3], [3.0, 0.0, 0.3]]), polygons=(BOX,))
    scene = ExtrudedWorld(world, circles=[[1.5, 2.0], [0.0, 2.0], [0.0, 2.0]], polygons=(0.0, 0.5))
    ray = np.array([direction], dtype=float)
    hit = cast_rays(np.array([0.0, 0.0, 0.4]), ray, *scene.obstacles(), (0.0, math.inf), 40.0)
    assert hit.item() == pytest.approx(distance, abs=KERNEL)


@given(SEEDS)
def test_infinitely_high_obstacles_are_where_the_planar_kernel_sees_them(seed):
    scene, (x, y, _), rng = furnished(seed)
    endless = ExtrudedWorld(scene.world, *[(-math.inf, math.inf)] * 3, ground=-math.inf)
    bearings, elevations = rng.uniform(-4, 4, 60), rng.uniform(-1.4, 1.4, 60)
    flat = np.cos(elevations)
    directions = np.column_stack([flat * np.cos(bearings), flat * np.sin(bearings), np.sin(elevations)])
    distances = cast_rays(np.array([x, y, 0.5]), directions, *endless.obstacles(), (-math.inf, math.inf), 1e3)
    world = scene.world
    planar = [
        cast_shapes((x, y, bearing), (0.0, 1e-3, 1), 100.0, world.circles, world.edges)[0]
        for bearing in bearings
    ]
    assert np.minimum(distances * flat, 100.0) == pytest.approx(np.array(planar), abs=RANGE)


@pytest.mark.parametrize(("gap", "behind"), [(0.0, 0.0), (1e-8, math.inf), (-1e-8, 1e-8)])
def test_on_a_wall_or_all_but(gap, behind):
    scene = ExtrudedWorld(World(segments=np.array([[gap, -1.0, gap, 1.0]])))
    directions = np.array([[-1.0, 0.0, 0.0], [-0.6, 0.8, 0.0], [-0.6, -0.8, 0.0]])
    hits = cast_rays(np.array([0.0, 0.0, 0.4]), directions, *scene.obstacles(), (0.0, math.inf), 40.0)
    assert hits == pytest.approx(np.full(3, behind), abs=1e-7)
