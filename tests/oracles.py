"""Slow obvious twins of the kernels: plain numpy and scipy, every pair looked at."""

import numpy as np
from scipy import stats
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from lme.geometry.motion import drive

HALF_DIAGONAL = np.sqrt(0.5)  # of a cell, as in lme/guides/lme_plus/travel_grid.py
SLIDE_SWEEPS = 2  # as in lme/geometry/skid.py


def cast(lidar_pose, angles, range_max, circles, edges):
    """Every beam against every circle and every edge."""
    x, y, yaw = lidar_pose
    bearing = yaw + angles[0] + angles[1] * np.arange(angles[2])
    direction = np.stack([np.cos(bearing), np.sin(bearing)])
    ranges = np.full(angles[2], float(range_max))
    for cx, cy, r in circles:
        along, across = _turned(cx - x, cy - y, direction)
        hit = (np.abs(across) <= r) & (along > 0)
        distance = along[hit] - np.sqrt(r**2 - across[hit] ** 2)
        ranges[hit] = np.minimum(ranges[hit], distance)
        if np.hypot(cx - x, cy - y) <= r:
            ranges[:] = 0
    for x0, y0, x1, y1 in edges:
        along0, across0 = _turned(x0 - x, y0 - y, direction)
        along1, across1 = _turned(x1 - x, y1 - y, direction)
        crosses = (across0 > 0) != (across1 > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = along0 + (along1 - along0) * across0 / (across0 - across1)
        hit = crosses & (distance >= 0)
        ranges[hit] = np.minimum(ranges[hit], distance[hit])
    return ranges


def cloud_scan(pose, beams, noise, height, limits, heights, spans, num_bins, circles, edges):
    """The cloud, point by point, then its projection. beams (N, 3) level at the sensor, noise (N,) [m]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    distances = np.full(len(beams), np.inf)
    for k, (dx, dy, dz) in enumerate(beams):
        flat = np.hypot(dx, dy)
        bearing = np.arctan2(sin * dx + cos * dy, cos * dx - sin * dy)
        upright = cast((pose[0], pose[1], bearing), (0.0, 1.0, 1), np.inf, circles, edges)[0] / flat
        distances[k] = min(upright, -height / dz if dz < 0 else np.inf)
    distances = np.where(distances > limits[1], np.inf, distances) + noise
    points = (beams * distances[:, None])[(distances >= limits[0]) & (distances < np.inf)]
    up, flat = points[:, 2] + height, np.hypot(points[:, 0], points[:, 1])
    points = points[(heights[0] <= up) & (up <= heights[1]) & (spans[0] <= flat) & (flat <= spans[1])]
    ranges = np.full(num_bins, np.inf)
    for x, y, _ in points:
        nearest = round((np.arctan2(y, x) + np.pi) / (2 * np.pi / num_bins)) % num_bins
        ranges[nearest] = min(ranges[nearest], np.hypot(x, y))
    return ranges


def sweep(poses, box, circles, edges):
    """Clearance at every pose up to the first contact."""
    least = np.inf
    for k, pose in enumerate(poses):
        clearance = footprint_clearance(pose, box, circles, edges)
        if clearance <= 0:
            return 0.0, k
        least = min(least, clearance)
    return least, -1


def followed(pose, twist, command, duration, limits_and_lag, footprint):
    """Poses and the twist while one command acts, with the steps of lme/planners/safety/kernels.py."""
    limits, lag = limits_and_lag
    steps = max(int(np.ceil(duration / 0.01 - 1e-9)), 1) if lag else 1
    goal, poses = np.clip(command, [-limits[0], -limits[1]], limits[:2]), []
    for _ in range(steps):
        wanted = goal + np.exp(-duration / steps / lag) * (np.array(twist) - goal) if lag else goal
        way, twist = drive(
            pose, twist, (*wanted,), limits, duration / steps, 0.02, footprint.circumscribed_radius
        )
        pose = (*way[-1],)
        poses.extend(way)
    return poses, twist


def stopping_clearance(points, twist, under_way, command, motion, footprint):
    """Least distance to the points over every pose of the motion until the robot stands; 0 in contact."""
    limits, period, late, lag = motion
    circles, pose, least = np.column_stack([points, np.zeros(len(points))]), (0.0, 0.0, 0.0), np.inf
    commands, durations = [*under_way, command], [period - late]
    slower, ramp = np.array(command, dtype=float), np.array(limits[2:]) * period
    while (
        commands
        or slower.any()
        or (np.abs(twist) @ [1.0, footprint.circumscribed_radius]) > (1e-4 / lag if lag else 0.0)
    ):
        if commands:
            acting = commands.pop(0)
        else:
            acting = slower = slower - np.clip(slower, -ramp, ramp)
        for duration in durations:
            way, twist = followed(pose, twist, acting, duration, (limits, lag), footprint)
            clearance, contact = sweep(way, footprint.box, circles, [])
            pose, least = (*way[-1],), min(least, clearance)
            if contact >= 0:
                return 0.0
        durations = [late, period - late] if late else [period]
    return least


def footprint_clearance(pose, box, circles, edges):
    """Distance from the rounded rectangle at `pose` to the nearest circle or edge; 0 or less in contact."""
    half_length, half_width, rounding = box
    half = np.array([half_length, half_width])
    least = np.inf
    for cx, cy, r in circles:
        centre = _into(pose, np.array([cx, cy]))
        nearest = np.clip(centre, -half, half)
        least = min(least, np.linalg.norm(centre - nearest) - r - rounding)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    for x0, y0, x1, y1 in edges:
        a, b = _into(pose, np.array([x0, y0])), _into(pose, np.array([x1, y1]))
        sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        distance = min(_between_segments(a, b, c, d) for c, d in sides)
        if (np.abs(a) <= half).all():
            distance = 0.0
        least = min(least, distance - rounding)
    return least


def fan_blocked(apex, ends, points, radius):
    """Every segment against every point."""
    blocked = np.zeros(len(ends), bool)
    q = points - apex
    for i, d in enumerate(ends - apex):
        along = q[:, 0] * d[0] + q[:, 1] * d[1]
        length = d[0] * d[0] + d[1] * d[1]
        before = _square(q) < radius * radius
        behind = _square(q - d) < radius * radius
        across = q[:, 0] * d[1] - q[:, 1] * d[0]
        beside = across * across < radius * radius * length
        near = np.where(along <= 0, before, np.where(along >= length, behind, beside))
        blocked[i] = near.any()
    return blocked


def cluster(points, gap, full_circle):
    """Every pair of points nearer than the gap marks every gap on the shorter arc between them."""
    count = len(points)
    spanned = np.zeros(count, bool)
    bearing = np.arctan2(points[:, 1], points[:, 0])
    pairs = cKDTree(points).query_pairs(gap * 1.001) if count else ()
    for i, j in pairs:
        if _square(points[i] - points[j]) >= gap * gap:
            continue
        if bearing[j] - bearing[i] <= np.pi:
            spanned[i:j] = True
        elif full_circle:
            spanned[j:] = True
            spanned[:i] = True
    if count and spanned.all():
        return np.array([[0, count - 1]]), True
    firsts = [i for i in range(count) if not spanned[i - 1]]
    sectors = []
    for first in firsts:
        last = first
        while spanned[last]:
            last = (last + 1) % count
        sectors.append([first, last])
    return np.array(sectors, dtype=np.int64).reshape(-1, 2), False


def scan_points(ranges, directions, range_min, range_max, mount):
    """Beams that hit something, moved into the base frame, sorted by atan2."""
    hit = np.isfinite(ranges) & (ranges >= np.float32(range_min)) & (ranges < np.float32(range_max))
    local = ranges[hit, None].astype(float) * directions[hit]
    cos, sin = np.cos(mount[2]), np.sin(mount[2])
    points = np.array(mount[:2]) + local @ np.array([[cos, sin], [-sin, cos]])
    return points[np.argsort(np.arctan2(points[:, 1], points[:, 0]), kind="stable")]


def slide(state, chassis, command, limits, factors, axes, yaw_errors, duration, count):
    """One step at a time, one contact at a time, with vectors; changes the state."""
    per_pose = int(np.ceil(duration / count / 1e-3 - 1e-9))
    dt = duration / (count * per_pose)
    body, wheels, poses = state.body, state.wheels, []
    for k in range(count * per_pose):
        goal = np.clip(command, np.negative(limits[:2]), limits[:2])
        most = np.array(limits[2:]) * dt
        if chassis.lag:
            goal = goal + (wheels[:2] - goal) * np.exp(-dt / chassis.lag)
        wheels[:2] += np.clip(goal - wheels[:2], -most, most)
        turn = wheels[1] * chassis.track / 2 * chassis.separation_multiplier
        treads = wheels[0] + turn * np.array([-1, 1])
        wheels[2:] += treads / chassis.wheel_radius * dt
        _friction(state, chassis, treads * factors, axes, dt)
        body[:3] += body[3:] * dt
        heading = body[2] + yaw_errors[k * len(yaw_errors) // (count * per_pose)]
        state.odometry[:] += wheels[0] * dt * np.array([np.cos(heading), np.sin(heading)])
        if (k + 1) % per_pose == 0:
            ahead = np.array([np.cos(body[2]), np.sin(body[2])])
            poses.append([*(body[:2] - chassis.com_x * ahead), body[2]])
    return np.array(poses)


def _friction(state, chassis, treads, axes, dt):
    """Sweeps over all contacts: each takes up the impulse that stops it, within the bounds of a box."""
    ahead = np.array([np.cos(state.body[2]), np.sin(state.body[2])])
    left = np.array([-ahead[1], ahead[0]])
    mass = np.diag([chassis.mass, chassis.mass, chassis.inertia])
    before, rows, old = state.body[3:].copy(), [], state.grip.copy()
    for n, (end, side, edge) in enumerate((e, s, t) for e in (1, -1) for s in (1, -1) for t in (-1, 1)):
        wheel = 0 if side == 1 else 1
        arm = (end * chassis.wheel_base / 2 - chassis.com_x) * ahead
        arm = arm + (side * chassis.track / 2 + edge * chassis.wheel_width / 2) * left
        share = 0.5 + end * chassis.com_x / chassis.wheel_base if chassis.wheel_base else 0.5
        load = chassis.mass * 9.81 * share / 4
        lever = chassis.mass * chassis.com_height / 4
        if chassis.wheel_base:
            load -= end * lever * state.acceleration[0] / chassis.wheel_base
        load -= side * lever * state.acceleration[1] / chassis.track
        direction, angle = (np.array([1.0, 0.0]) if axes == 1 else ahead), state.wheels[2 + wheel]
        if axes == 0:
            load += old[2 * n] / dt * np.sin(angle)
            direction = direction * np.cos(angle)
        for d in (direction, np.array([-direction[1], direction[0]])):
            rows.append(
                (np.array([*d, arm[0] * d[1] - arm[1] * d[0]]), treads[wheel] * ahead, max(load, 0.0))
            )
    state.grip[:] = 0
    for _ in range(SLIDE_SWEEPS):
        for n, (row, tread, load) in enumerate(rows):
            sliding = row @ state.body[3:] - row[:2] @ tread
            stiffness = 1 / (row @ np.linalg.solve(mass, row)) if np.abs(row).max() > 1e-6 else 0.0
            bound = chassis.friction * load * dt
            total = np.clip(state.grip[n] - sliding * stiffness, -bound, bound)
            state.body[3:] += np.linalg.solve(mass, row) * (total - state.grip[n])
            state.grip[n] = total
    change = (state.body[3:5] - before[:2]) / dt
    state.acceleration[:] = change @ ahead, change @ left


def _turned(x, y, direction):
    """Components of (x, y) along and across each direction (2, B)."""
    return x * direction[0] + y * direction[1], x * direction[1] - y * direction[0]


def _into(pose, point):
    """A point of the world in the frame at `pose`."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[cos, sin], [-sin, cos]]) @ (point - np.asarray(pose[:2]))


def _square(vectors):
    return vectors[..., 0] * vectors[..., 0] + vectors[..., 1] * vectors[..., 1]


def _between_segments(a, b, c, d):
    """Distance between segments a–b and c–d: 0 where they cross, else from one of the four ends."""

    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return 0.0
    return min(_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))


def _to_segment(point, start, end):
    along = end - start
    length = along @ along
    part = np.clip((point - start) @ along / length, 0, 1) if length > 0 else 0.0
    return np.linalg.norm(point - start - part * along)


def slow_interval_over_worlds(successes, worlds):
    """Wilson's interval with the effective number of episodes, world by world."""
    n, rate = len(successes), sum(successes) / len(successes)
    by_world = {world: [s for s, w in zip(successes, worlds, strict=True) if w == world] for world in worlds}
    between = sum((sum(runs) - rate * len(runs)) ** 2 for runs in by_world.values()) / n**2
    if 0 < rate < 1:
        effective = n if between == 0 else min(n, rate * (1 - rate) / between)
    else:
        effective = n**2 / sum(len(runs) ** 2 for runs in by_world.values())

    # Wilson: the p whose distance to the rate is z of its own standard errors, (rate − p)² = z² p (1 − p) / effective
    square = stats.norm.ppf(0.975) ** 2 / effective
    low, high = sorted(np.roots([1 + square, -(2 * rate + square), rate**2]).real)
    return low, high


def crc32c(data):
    """Bit by bit, as RFC 3720 says it."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def dense(inputs, kernel, bias, slope):
    """A layer in float64."""
    out = inputs.astype(np.float64) @ kernel.astype(np.float64) + bias
    return np.where(out > 0, out, slope * out)


def nearest_returns(ranges, sectors, angles, limits, unseen, offset):
    """Every sector on its own: its beams counter-clockwise, the nearest of them, or the point of no beam."""
    out = []
    for s, point in enumerate(unseen):
        beams = [i for i in range(len(ranges)) if sectors[i] == s]
        if beams:
            middle = np.arctan2(*unseen[s][::-1])
            beams.sort(key=lambda i: np.remainder(angles[i] - middle + np.pi, 2 * np.pi))
            reach = [
                float(ranges[i]) if np.float32(limits[0]) <= ranges[i] < np.float32(limits[1]) else limits[2]
                for i in beams
            ]
            k = int(np.argmin(reach))
            point = reach[k] * np.array([np.cos(angles[beams[k]]), np.sin(angles[beams[k]])])
        about = point + np.array(offset)
        distance = np.hypot(*about)
        out.append([*(about / distance if distance > 0 else (0.0, 0.0)), distance])
    return np.array(out)


def outline_cells(outline, pose, grid):
    """Cells (set of array indices) on the lines between the cells of the corners, by Bresenham's closed form."""
    corners = [cell_of(corner, grid) for corner in outwards(pose, outline)]
    found = set()
    for (i, j), (a, b) in zip(corners, corners[1:] + corners[:1], strict=True):
        most, least = max(abs(a - i), abs(b - j)), min(abs(a - i), abs(b - j))
        for k in range(most + 1):
            across = (most // 2 + k * least) // max(most, 1)
            steps = (k, across) if abs(a - i) >= abs(b - j) else (across, k)
            found.add((int(i + np.sign(a - i) * steps[0]), int(j + np.sign(b - j) * steps[1])))
    return found


def covered_cells(outline, pose, grid, shape):
    """Cells on the outline, and in every row all between two of them."""
    cells = outline_cells(outline, pose, grid)
    covered = np.zeros(shape, dtype=bool)
    for i in {i for i, _ in cells}:
        row = [j for k, j in cells if k == i]
        covered[i, min(row) : max(row) + 1] = True
    return covered


def grid_distances(free, cells):
    """Steps over the sides of cells to the nearest of `cells`, ring by ring; -1 where no way leads."""
    steps = np.full(free.shape, -1)
    for i, j in cells:
        steps[i, j] = 0
    for distance in range(free.size):
        ring = np.pad(steps == distance, 1)
        beside = ring[:-2, 1:-1] | ring[2:, 1:-1] | ring[1:-1, :-2] | ring[1:-1, 2:]
        new = beside & free & (steps < 0)
        if not new.any():
            return steps
        steps[new] = distance + 1
    return steps


def trajectory_score(wanted, pose, twist, alphas, simulation, outline, costs, grid, to_path, to_goal, scales):
    """Score and last scored pose of one trajectory, pose after pose; -1 contact, -2 no way."""
    time, step, turn_step = simulation
    steps = max(int(max(abs(wanted[0]) * time / step, abs(wanted[1]) / turn_step) + 0.5), 1)
    dt, highest, here, speed = time / steps, 0, tuple(pose), list(twist)
    for _ in range(steps):
        cells = outline_cells(outline, here, grid)
        if any(not (0 <= i < costs.shape[0] and 0 <= j < costs.shape[1]) for i, j in cells):
            return -1.0, here
        under = max(int(costs[cell]) for cell in cells)
        if under == 254:
            return -1.0, here
        centre = cell_of(here[:2], grid)
        if to_path[centre] < 0 or to_goal[centre] < 0:
            return -2.0, here
        highest, last = max(highest, under, int(costs[centre])), here
        for k in (0, 1):
            speed[k] = np.clip(wanted[k], speed[k] - alphas[k] * dt, speed[k] + alphas[k] * dt)
        x, y, yaw = here
        here = x + speed[0] * np.cos(yaw) * dt, y + speed[0] * np.sin(yaw) * dt, yaw + speed[1] * dt
    at_end = cell_of(last[:2], grid)
    return scales[0] * to_path[at_end] + scales[1] * to_goal[at_end] + scales[2] * highest, last


def mppi_rollout(sequence, noise, stds, twist, pose, limits, dt):
    """Controls, speeds and poses of all trajectories at once, step by step."""
    controls = sequence + noise * np.array(stds)
    samples, steps = noise.shape[:2]
    speeds, poses = np.empty((samples, steps)), np.empty((samples, steps, 3))
    now, here = np.tile(twist, (samples, 1)).astype(float), np.tile(pose, (samples, 1)).astype(float)
    for k in range(steps):
        heading = np.stack([np.cos(here[:, 2]), np.sin(here[:, 2])], axis=1)
        here = here + dt * np.column_stack([now[:, :1] * heading, now[:, 1]])
        speeds[:, k], poses[:, k] = now[:, 0], here
        if k < steps - 1:
            forward = now[:, 0] > 0.0
            low = np.where(forward, limits[3], -limits[4]) * dt
            high = np.where(forward, limits[4], -limits[3]) * dt
            controls[:, k, 0] = np.clip(controls[:, k, 0], now[:, 0] + low, now[:, 0] + high)
            turn = limits[5] * dt
            controls[:, k, 1] = np.clip(controls[:, k, 1], now[:, 1] - turn, now[:, 1] + turn)
            now = controls[:, k]
    return controls, speeds, poses


def mppi_average(controls, costs, temperature):
    """The softmax of the costs times the controls."""
    weights = np.exp(-(costs - costs.min()) / temperature)
    return np.einsum("n,ntc->tc", weights / weights.sum(), controls)


def mppi_obstacles(poses, step, cells, grid, outline, possible, prices, near_goal):
    """Costs (N,) of trajectories on a map, and whether each collides: every looked-at pose on its own."""
    looked_at = poses.shape[1] // step
    costs, collides = np.zeros(len(poses)), np.zeros(len(poses), dtype=bool)
    for n, way in enumerate(poses.astype(float)):
        for pose in way[::step][:looked_at]:
            i, j = cell_of(pose[:2], grid)
            off = not (0 <= i < cells.shape[0] and 0 <= j < cells.shape[1])
            cost = 255 if off else int(cells[i, j])
            under = outline_cells(outline, pose, grid)
            on_map = all(0 <= a < cells.shape[0] and 0 <= b < cells.shape[1] for a, b in under)
            touches = not on_map or max(int(cells[cell]) for cell in under) == 254
            if off or (0 < cost and cost >= possible and touches):
                costs[n], collides[n] = prices[0], True
                break
            costs[n] += prices[1] if cost >= 253 else 0.0 if near_goal else cost
    return costs * prices[2] / 254.0 / looked_at, collides


def mppi_path_align(poses, path, free, furthest, step, weight):
    """Mean distance of the strided poses to the free points at their lengths of way: nearest entry, never backwards."""
    ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(path[:furthest], axis=0).T)))
    costs = np.zeros(len(poses))
    for n, way in enumerate(poses[:, ::step, :2].astype(float)):
        lengths, at, apart = np.cumsum(np.hypot(*np.diff(way, axis=0).T)), 0, []
        for point, length in zip(way[1:], lengths, strict=True):
            later = np.flatnonzero(ways[at + 1 :] > length) + at + 1
            if len(later) == 0:
                at = furthest - 1
            else:
                before, after = ways[later[0] - 1], ways[later[0]]
                at = later[0] - 1 if length - before < after - length else later[0]
            if free[at]:
                apart.append(np.hypot(*(path[at] - point)))
        costs[n] = weight * np.mean(apart) if apart else 0.0
    return costs


def outwards(pose, points):
    x, y, yaw = pose
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return np.array([x, y]) + points @ turn


def cell_of(point, grid):
    """Array index of the cell of a point; halves are rounded away from zero."""
    scaled = np.asarray(point) / grid[2]
    i, j = (np.copysign(np.floor(np.abs(scaled) + 0.5), scaled)).astype(int)
    return int(i - grid[0]), int(j - grid[1])


def discs_in_sight(discs, velocities, ranges, angles, limits, lidar, base):
    """The beam nearest to each disc's middle, by looking at every beam."""
    found = []
    for (x, y, r), velocity in zip(discs, velocities, strict=True):
        bearing = np.arctan2(y - lidar[1], x - lidar[0]) - lidar[2]
        away = bearing - angles[0] - angles[1] * np.arange(len(ranges))
        away = np.abs((away + np.pi) % (2 * np.pi) - np.pi)
        surface = np.hypot(x - lidar[0], y - lidar[1]) - r
        if not len(away) or away.min() > angles[1] / 2 or surface >= limits[1]:
            continue
        if not limits[0] <= ranges[away.argmin()] < surface - limits[2]:
            cos, sin = np.cos(base[2]), np.sin(base[2])
            to_robot = np.array([[cos, sin], [-sin, cos]])
            found.append([*to_robot @ [x - base[0], y - base[1]], *to_robot @ velocity])
    return np.array(found).reshape(-1, 4)


def disc(size):
    """Cells (size, size) whose centre is within half the side of the grid, less a cell, of its middle, and its edge."""
    along = np.arange(size) - (size - 1) / 2
    inside = np.hypot(*np.meshgrid(along, along, indexing="ij")) <= size / 2 - 1
    framed = np.pad(inside, 1)
    around = [np.roll(framed, by, axis)[1:-1, 1:-1] for by in (1, -1) for axis in (0, 1)]
    return inside, inside & ~np.all(around, axis=0)


def passages(points, grid, pace):
    """Half of the width of the narrow passage about each cell (size, size) [m], by all pairs of points; 0: none."""
    size, cell, corner = grid.size, grid.cell, np.array((grid.x, grid.y))
    half, ring = np.zeros((size, size)), [(a, b) for a in range(-2, 3) for b in range(-2, 3)]
    ring = [each for each in ring if 2.0 <= np.hypot(*each) < 2.5]
    centres = corner[:, None, None] + (np.indices((size + 4, size + 4)) - 1.5) * cell
    d = np.hypot(*(centres[..., None] - points.T[:, None, None])).min(axis=-1, initial=np.inf)
    of_cell = np.floor((points - corner) / cell)
    inside = ((of_cell >= 0) & (of_cell < size)).all(axis=1)
    points, of_cell = points[inside], of_cell[inside]
    for i, j in np.argwhere((d < pace.inner) & (d >= max(pace.tight - HALF_DIAGONAL * cell, 0.5 * cell))):
        if not (2 <= i < size + 2 and 2 <= j < size + 2):
            continue
        around = [(d[i + a, j + b], d[i, j] + 0.9 * cell * np.hypot(a, b)) for a, b in ring]
        ways = points - centres[:, i, j]
        near = ways[(np.abs(of_cell - (i - 2, j - 2)) <= int(d[i, j] / cell + 0.5)).all(axis=1)]
        if any(there >= min(most, pace.comfort) for there, most in around) or not len(near):
            continue
        nearest = min(near, key=np.linalg.norm)
        widths = np.linalg.norm(ways[ways @ nearest < 0.0] - nearest, axis=1)
        half[i - 2, j - 2] = widths.min(initial=np.inf) / 2
    return np.where(half < pace.inner, half, 0.0)


def within_disc(place, size):
    """Whether a (row, column), from 1, is at least a cell's diagonal inside the disc."""
    return np.hypot(*(np.asarray(place) - (size + 1) / 2)) <= size / 2 - 1 - np.sqrt(2.0)


def travel_times(points, target, robot, grid, pace, leave):
    """Shortest times from the target over the cells to each of 32 neighbours: (size, size) [s]."""
    size, cell = grid.size, grid.cell
    along = (np.arange(size) + 0.5) * cell
    x, y = np.meshgrid(grid.x + along, grid.y + along, indexing="ij")
    d = (
        np.min([np.hypot(x - px, y - py) for px, py in points], axis=0)
        if len(points)
        else np.full_like(x, np.inf)
    )
    nearest = min([pace.inner, *(np.hypot(*(point - robot)) for point in points)]) - HALF_DIAGONAL * cell
    blocked = (d < pace.inner) & ((np.hypot(x - robot[0], y - robot[1]) > pace.room) | (d < nearest))
    share = (pace.comfort - np.clip(d, pace.inner, pace.comfort)) / (pace.comfort - pace.inner)
    slowness = np.where(blocked, np.inf, (1 + pace.slowdown * share**2) / pace.v_max)
    straight = np.hypot(x - target[0], y - target[1]) / pace.v_max
    inside, edge = disc(size)
    slowness[~inside] = np.inf
    if within_disc((np.asarray(target) - (grid.x, grid.y)) / cell + 0.5, size):
        starts = (np.abs(x - target[0]) <= cell) & (np.abs(y - target[1]) <= cell)
    else:
        starts, leave = np.zeros((size, size), bool), True
    if leave:
        starts |= edge
    return _shortest_times(slowness * cell, np.where(starts, straight, np.inf))


def _shortest_times(costs, starts):
    """Dijkstra; an edge costs its length times the mean of `costs` in the rectangle between its ends."""
    size = len(costs)
    number = np.arange(size * size).reshape(size, size)
    steps = [(a, b) for a in range(-3, 4) for b in range(-3, 4) if np.gcd(a, b) == 1]
    edges = []
    for a, b in steps:
        i, j = np.nonzero(np.ones((size, size), bool))
        inside = (i + a >= 0) & (i + a < size) & (j + b >= 0) & (j + b < size)
        i, j = i[inside], j[inside]
        rows, columns = (np.sign(k) * np.arange(abs(k) + 1) for k in (a, b))
        samples = [costs[i + row, j + column] for row in rows for column in columns]
        edges.append((number[i, j], number[i + a, j + b], np.hypot(a, b) * np.mean(samples, axis=0)))
    begin = np.full(np.isfinite(starts).sum(), size * size)
    edges.append((begin, number[np.isfinite(starts)], np.maximum(starts[np.isfinite(starts)], 1e-12)))
    tail, head, cost = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    kept = np.isfinite(cost)
    graph = csr_array((cost[kept], (tail[kept], head[kept])), shape=(size * size + 1,) * 2)
    return dijkstra(graph, indices=size * size)[:-1].reshape(size, size)


def remember(memory, points, ranges, beams, mount, pose, square, reach, slack, range_max):
    """Point by point, with every beam's bearing."""
    placed = np.asarray(outwards(pose, points)).reshape(-1, 2)
    lidar = outwards(pose, np.array([mount[:2]]))[0]
    bearings = pose[2] + mount[2] + beams[0] + beams[1] * np.arange(len(ranges))
    squares = {}
    for new, point in [*((True, point) for point in placed), *((False, point) for point in memory)]:
        if np.hypot(*(point - pose[:2])) > reach:
            continue
        at = tuple(np.floor(point / square))
        if not new:
            dx, dy = point - lidar
            away = np.abs((np.arctan2(dy, dx) - bearings + np.pi) % (2 * np.pi) - np.pi)
            k = int(away.argmin())
            inside = away[k] <= abs(beams[1]) / 2
            about = ranges[max(k - 1, 0) : k + 2]
            in_range = np.hypot(dx, dy) + slack <= range_max
            if inside and in_range and (about > np.hypot(dx, dy) - slack).all():
                continue
        squares.setdefault(at, point)
    return np.array(list(squares.values())).reshape(-1, 2)


def split(points, seen, people, most, skin):
    """Every point against every person: the points of nobody, and the radius of each person."""
    radii = _apart(people[:, :2], seen).min(axis=1, initial=most)
    own = _apart(points, people[:, :2]) < radii + skin
    return points[~own.any(axis=1)], np.column_stack((people, radii))


def meeting(twist, movers, reach, step, horizon, held=np.inf, brake=0.0):
    """Places at all times; the last time before any mover is both near and nearer than a step earlier; inf: none."""
    v, omega = twist
    times = step * np.arange(int(horizon / step + 0.5) + 1)
    late = np.maximum(times - held, 0.0)
    driven = times - (late**2 * brake / (2.0 * v) if brake else 0.0)  # the arc's length is v · driven
    way = v * driven if omega == 0.0 else v * (np.exp(1j * omega * driven) - 1.0) / (1j * omega)
    x, y, vx, vy, radii = movers.T[..., None]
    away = np.abs(x + 1j * y + (vx + 1j * vy) * times - way)
    meets = (away[:, 1:] < reach + radii) & (away[:, 1:] < away[:, :-1])
    return min((times[np.argmax(one)] for one in meets if one.any()), default=np.inf)


def _apart(one, other):
    """(N, M) distances between all places."""
    return np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1))


def march(slownesses, target, robot, size, cell_time, beyond, enclosed, buckets, gain, learned):
    """The untidy fast marching in its order, cell by cell, with a list for each bucket and nothing stored between."""
    times, tentative = np.full((2, size + 2, size + 2), np.inf)
    inside, edge = (np.pad(each, 1) for each in disc(size))
    (x, y), (rx, ry) = target, robot
    about = [(i, j) for i in (int(x), int(x) + 1) for j in (int(y), int(y) + 1)]
    sources = about if within_disc(target, size) else []
    at_target = len(sources)
    if not enclosed:
        sources = sources + [(int(i), int(j)) for i, j in np.argwhere(edge)]
    queue = [[] for _ in range(buckets)]
    first = np.floor(np.hypot(x - rx, y - ry)) - 2.0
    for n, (i, j) in enumerate(sources):
        time = np.hypot(i - x, j - y) * cell_time
        tentative[i, j] = time if n < at_target else max(time, learned[i - 1, j - 1])
        key = tentative[i, j] / cell_time + np.hypot(i - rx, j - ry) - first
        queue[min(int(key), buckets - 1)].append((i, j))
    here = tuple(min(max(int(at + 0.5), 1), size) for at in robot)
    bucket, stop = 0, buckets
    while bucket < stop:
        if not queue[bucket]:
            bucket += 1
            continue
        at = queue[bucket].pop()
        if times[at] <= tentative[at]:
            continue
        times[at] = tentative[at]
        if at == here:
            stop = min(bucket + int(beyond / cell_time) + 1, buckets)
        for i, j in ((at[0], at[1] + 1), (at[0], at[1] - 1), (at[0] + 1, at[1]), (at[0] - 1, at[1])):
            if not inside[i, j] or times[at] >= min(times[i, j], tentative[i, j] - gain * cell_time):
                continue
            step = slownesses[i - 1, j - 1]
            a, b = min(times[i - 1, j], times[i + 1, j]), min(times[i, j - 1], times[i, j + 1])
            two = abs(a - b) < step < np.inf
            time = 0.5 * (a + b + np.sqrt(2.0 * step * step - (a - b) ** 2)) if two else min(a, b) + step
            if time < tentative[i, j] - gain * cell_time:
                tentative[i, j] = time
                key = time / cell_time + np.hypot(i - rx, j - ry) - first
                queue[max(min(int(key), buckets - 1), bucket)].append((i, j))
    return times, times[here]


def nearest_by_sector_slow(points, sectors, reach):
    """Distance of the nearest of the points whose bearing is nearest to each sector's."""
    found = [reach] * sectors
    for x, y in points:
        turns = np.degrees(np.arctan2(y, x)) / (360.0 / sectors)
        k = round(turns) % sectors
        found[k] = min(found[k], float(np.linalg.norm([x, y])))
    return np.array(found)


def teb_errors(poses, times, twist, near, via, turn, box, bounds, weights):
    """Errors of a timed elastic band, each times the root of its weight: one after the other, as in the papers."""
    back, fastest, omega_max, alpha_v, alpha_omega, wanted, epsilon = bounds

    def beyond(value, low, high):
        return max(low + epsilon - value, 0.0) if value < low + epsilon else max(value - high + epsilon, 0.0)

    def wrapped(angle):
        return np.arctan2(np.sin(angle), np.cos(angle))

    speeds, rates, errors = [], [], []
    for (x0, y0, yaw0), (x1, y1, yaw1), t in zip(poses, poses[1:], times, strict=False):
        ahead = np.cos(yaw0) * (x1 - x0) + np.sin(yaw0) * (y1 - y0)
        speeds.append(np.hypot(x1 - x0, y1 - y0) / t * 100 * ahead / (1 + abs(100 * ahead)))
        rates.append(wrapped(yaw1 - yaw0) / t)
        aside = (np.cos(yaw0) + np.cos(yaw1)) * (y1 - y0) - (np.sin(yaw0) + np.sin(yaw1)) * (x1 - x0)
        errors += [(weights[0], t), (weights[1], beyond(speeds[-1], -back, fastest))]
        errors += [(weights[2], beyond(rates[-1], -omega_max, omega_max))]
        errors += [(weights[5], aside), (weights[6], max(-ahead, 0.0))]
        if len(speeds) <= 3:
            errors.append((weights[9], max(-turn * wrapped(yaw1 - yaw0), 0.0)))
    spans = [times[0], *(0.5 * (times[1:] + times[:-1])), times[-1]]
    for values, start, most, weight in (
        (speeds, twist[0], alpha_v, weights[3]),
        (rates, twist[1], alpha_omega, weights[4]),
    ):
        changes = np.diff([start, *values, 0.0]) / spans
        errors += [(weight, beyond(change, -most, most)) for change in changes]
    for i, x, y in near:
        errors.append((weights[7], max(wanted + epsilon - teb_clearance(poses[int(i)], x, y, box), 0.0)))
    for i, x, y in via:
        errors.append((weights[8], np.hypot(poses[int(i)][0] - x, poses[int(i)][1] - y)))
    return np.array([np.sqrt(weight) * error for weight, error in errors])


def teb_clearance(pose, x, y, box):
    """Distance of a point from the footprint: to the box, or minus the way out of it, less the rounding."""
    out = np.abs(_into(pose, np.array([x, y]))) - box[:2]
    return (np.hypot(*np.maximum(out, 0.0)) if (out > 0.0).any() else out.max()) - box[2]


def teb_resized(poses, times, wanted, hysteresis, fewest, most):
    """Samples inserted in and deleted from plain lists, pass after pass."""
    poses, times = [list(pose) for pose in poses], list(times)
    for _ in range(100):
        before, i = len(times), 0
        added = False
        while i < len(times):
            if times[i] > wanted + hysteresis and len(times) < most:
                if times[i] > 2 * wanted:
                    (x0, y0, yaw0), (x1, y1, yaw1) = poses[i], poses[i + 1]
                    yaw = np.arctan2(np.sin(yaw0) + np.sin(yaw1), np.cos(yaw0) + np.cos(yaw1))
                    poses.insert(i + 1, [(x0 + x1) / 2, (y0 + y1) / 2, yaw])
                    times[i : i + 1] = [times[i] / 2, times[i] / 2]
                    added = True
                    continue
                if i + 1 < len(times):
                    times[i + 1] += times[i] - wanted
                times[i] = wanted
            elif times[i] < wanted - hysteresis and len(times) > fewest:
                added = True
                if i + 1 < len(times):
                    times[i : i + 2] = [times[i] + times[i + 1]]
                    del poses[i + 1]
                    continue
                times[i - 1 :] = [times[i - 1] + times[i]]
                del poses[i]
            i += 1
        if not added and len(times) == before:
            break
    return np.array(poses), np.array(times)


def teb_near(poses, points, box, always, never):
    """Rows (pose, x, y) of the obstacles that count: every pose with every point, sorted."""
    rows = []
    for i in range(1, len(poses) - 1):
        distances = [teb_clearance(poses[i], x, y, box) for x, y in points]
        rows += [(i, *points[k]) for k, away in enumerate(distances) if away < always]
        far = [k for k, away in enumerate(distances) if always <= away <= never]
        left = {k for k in far if _into(poses[i], points[k])[1] > 0}
        for side in (left, set(far) - left):
            if side:
                rows.append((i, *points[min(side, key=distances.__getitem__)]))
    return sorted(rows)


def least_times(times, grid, here, most, v_max):
    """What a search of all ways of up to `most` from `here` says of each cell and the frame about them."""
    centres = [low + (np.arange(grid.size + 2) - 0.5) * grid.cell for low in (grid.x, grid.y)]
    x, y = np.meshgrid(*centres, indexing="ij")
    return np.minimum(times, most - np.hypot(x - here[0], y - here[1]) / v_max)


class RosBand:
    """eband_local_planner's band by recursion; bubbles are tuples (x, y, yaw, expansion)."""

    def __init__(self, costs, grid, rules):
        self.costs, self.grid, self.rules = costs, grid, rules

    def expansion(self, x, y):
        i, j = cell_of((x, y), self.grid)
        on_map = 0 <= i < len(self.costs) and 0 <= j < len(self.costs[0])
        cost = max(int(self.costs[i, j]), 1) if on_map else 1
        return 0.0 if cost > 252 else -np.log(cost / 252) / self.rules.costmap_weight

    def bubble(self, x, y, yaw):
        return x, y, np.angle(np.exp(1j * yaw)), self.expansion(x, y)

    def overlap(self, a, b):
        return np.hypot(a[0] - b[0], a[1] - b[1]) < self.rules.min_relative_overlap * (a[3] + b[3])

    def fill(self, a, b):
        """The bubbles that join two, these included; None if one of them is too small."""
        turn = np.angle(np.exp(1j * (b[2] - a[2])))
        middle = self.bubble((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, a[2] + turn / 2)
        if middle[3] <= self.rules.tiny_bubble_expansion:
            return None
        left = [a, middle] if self.overlap(a, middle) else self.fill(a, middle)
        right = [middle, b] if self.overlap(middle, b) else self.fill(middle, b)
        return None if left is None or right is None else left + right[1:]

    def refine(self, band):
        if self.overlap(band[0], band[-1]):
            return [band[0], band[-1]]
        if len(band) == 2:
            return self.fill(*band)
        middle = (len(band) - 1) // 2
        left, right = self.refine(band[: middle + 1]), self.refine(band[middle:])
        if left is None or right is None:
            return None
        return left[:-1] + (right[1:] if self.overlap(left[-2], right[1]) else right)

    def difference(self, a, b):
        turn = np.angle(np.exp(1j * (b[2] - a[2])))
        return np.array([b[0] - a[0], b[1] - a[1], turn * self.rules.circumscribed_radius])

    def force(self, band, i, bubble):
        rules, (x, y, _, r) = self.rules, bubble
        force = np.zeros(3)
        for other in (band[i - 1], band[i + 1]):
            distance = np.hypot(other[0] - x, other[1] - y)
            if distance > rules.tiny_bubble_distance:
                force += rules.internal_force_gain * self.difference(bubble, other) / distance
        across = self.expansion(x + r, y) - self.expansion(x - r, y)
        up = self.expansion(x, y + r) - self.expansion(x, y - r)
        slope = rules.external_force_gain / (2 * max(r, rules.tiny_bubble_expansion))
        force += slope * np.array([across, up, 0.0])
        along = self.difference(band[i + 1], band[i - 1])
        return force - force @ along / (along @ along) * along

    def overshoots(self, new, old):
        before = np.sqrt(2 * old[0] ** 2 + old[2] ** 2)
        strength = np.linalg.norm(new)
        least = max(self.rules.relative_overshoot * before, self.rules.significant_force)
        return new @ old < 0 and strength > least

    def equilibrium(self, band, i, bubble, force, step, depth):
        moved = self.bubble(*(np.array(bubble[:3]) + step))
        if moved[3] == 0.0:
            return None
        new = self.force(band, i, moved)
        if depth == self.rules.max_recursion_depth or (new @ force < 0 and not self.overshoots(new, force)):
            return moved
        half = step / 2 if new @ force >= 0 else -step / 2
        return self.equilibrium(band, i, moved, new, half, depth + 1) or moved

    def move(self, band, i):
        force, radius = self.force(band, i, band[i]), band[i][3]
        step = radius * force / np.array([1.0, 1.0, self.rules.circumscribed_radius])
        step[2] = np.angle(np.exp(1j * step[2]))
        moved = self.bubble(*(np.array(band[i][:3]) + step))
        if moved[3] <= self.rules.tiny_bubble_expansion:
            return
        if self.overshoots(self.force(band, i, moved), force):
            moved = self.equilibrium(band, i, band[i], force, step / 2, 0) or moved
        if all(self.overlap(band[k], moved) or self.fill(band[k], moved) for k in (i - 1, i + 1)):
            band[i] = moved

    def optimize(self, band):
        band = [self.bubble(*pose[:3]) for pose in band]
        if any(bubble[3] <= 0.0 for bubble in band):
            return None
        band = self.refine(band)
        for _ in range(self.rules.num_iterations):
            if band is None:
                break
            inner = list(range(1, len(band) - 1))
            for i in inner + inner[::-1]:
                self.move(band, i)
            band = self.refine(band)
        return band


def navfn_potential(paid, start):
    """Every cell in turn by Navfn's rule, until none changes."""
    g = np.full(paid.shape, np.inf)
    g[start] = 0.0
    changed = True
    while changed:
        changed = False
        for i in range(1, paid.shape[0] - 1):
            for j in range(1, paid.shape[1] - 1):
                low, high = sorted((min(g[i - 1, j], g[i + 1, j]), min(g[i, j - 1], g[i, j + 1])))
                if np.isinf(paid[i, j]) or np.isinf(low):
                    continue
                share = (high - low) / paid[i, j]
                part = 1.0 if share >= 1.0 else 0.704 + 0.5307 * share - 0.2301 * share**2
                if low + part * paid[i, j] < g[i, j]:
                    g[i, j], changed = low + part * paid[i, j], True
    return g
