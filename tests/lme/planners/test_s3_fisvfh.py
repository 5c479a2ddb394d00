"""S3-FISVFH: its kernels against slow twins, its fuzzy curves, and how it drives."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.s3_fisvfh.kernels import (
    Costs,
    Valleys,
    headings,
    histogram,
    least_clearance,
    nearest_ahead,
    search,
    valleys,
)
from lme.planners.s3_fisvfh.planner import FuzzyCurve, S3Fisvfh
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, shipped, stage
from tests.lme.planners import drives
from tests.tolerances import KERNEL

SECTORS = 120
WIDTH = 2 * math.pi / SECTORS
NARROW, WIDE = 12 * WIDTH, 22 * WIDTH
RULES = Valleys(4.0, 1.1, NARROW, WIDE, NARROW)
COSTS = Costs(0.6, 1.9, 3.8, 2)
COORDINATE = st.floats(-5.0, 5.0).map(lambda value: round(value, 3))
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE), max_size=60).map(
    lambda rows: np.array(rows, dtype=float).reshape(-1, 2)
)


# --- slow twins -------------------------------------------------------------------------------------------


def wrapped(angle):
    return math.remainder(angle, math.tau)


def slow_histogram(points, x, y, spacing, window):
    density = np.zeros(SECTORS)
    for point in points:
        distance = math.dist(point, (x, y))
        if distance >= window:
            continue
        half = min(spacing * math.hypot(*point) / max(distance, 1e-9) / 2, math.pi / 2)
        bearing = math.atan2(point[1] - y, point[0] - x)
        for s in range(SECTORS):
            left = -math.pi + s * WIDTH
            for turn in (-math.tau, 0.0, math.tau):
                overlap = min(left + WIDTH, bearing + turn + half) - max(left, bearing + turn - half)
                density[s] += max(overlap, 0.0) / WIDTH * (window - distance)
    return np.minimum(density, window)


def slow_headings(blocked, goal, narrow, wide, margin):
    if not any(blocked):
        return [goal]
    out = []
    for first in range(len(blocked)):
        if blocked[first] or not blocked[first - 1]:
            continue
        length = next(n for n in range(len(blocked)) if blocked[(first + n) % len(blocked)])
        left, right = -math.pi + first * WIDTH, -math.pi + (first + length) * WIDTH
        if right - left < narrow - 1e-9:
            continue
        middle = (left + right) / 2
        low, high = left + margin - middle, right - margin - middle
        if right - left <= wide + 1e-9 or low > high:
            low = high = 0.0
        out.append(wrapped(middle + min(max(wrapped(goal - wrapped(middle)), low), high)))
    return out


def slow_paths(points, unseen, goal, spacing, rules, costs, x, y, before, depth, cost, first):
    """Every way of the search: (depth it reaches, its cost, its first heading)."""
    if depth == costs.depth:
        return [(depth, cost, first)]
    to_goal, bearing = math.dist(goal, (x, y)), math.atan2(goal[1] - y, goal[0] - x)
    density = slow_histogram(points, x, y, spacing, rules.window)
    blocked = unseen | (density > rules.window - min(rules.block_distance, to_goal))
    found = [(depth, cost, first)]
    for heading in slow_headings(blocked, bearing, rules.narrow, rules.wide, rules.margin):
        turn = costs.deviation * abs(wrapped(heading - bearing)) + costs.switch * abs(
            wrapped(heading - before)
        )
        found += slow_paths(
            points,
            unseen,
            goal,
            spacing,
            rules,
            costs,
            x + costs.step * math.cos(heading),
            y + costs.step * math.sin(heading),
            heading,
            costs.depth if to_goal <= costs.step else depth + 1,
            cost + costs.step + turn,
            heading if first is None else first,
        )
    return found


def slow_curve(value, inputs, outputs):
    """Mamdani inference by its definition, on a fine grid."""

    def triangle(at, peaks, k):
        sides = [abs(peaks[j] - peaks[k]) for j in (k - 1, k + 1) if 0 <= j < len(peaks)]
        inner = sides[0] if len(sides) == 1 or at <= peaks[k] else sides[1]
        return max(0.0, 1.0 - abs(at - peaks[k]) / inner)

    value = min(max(value, inputs[0]), inputs[-1])
    total = moment = 0.0  # the ends of the universe count as much as any sample: 1e-3 of slack
    for at in np.linspace(min(outputs), max(outputs), 1401):
        degree = max(min(triangle(value, inputs, k), triangle(at, outputs, k)) for k in range(len(inputs)))
        total, moment = total + degree, moment + degree * at
    return moment / total


# --- kernels ----------------------------------------------------------------------------------------------


@given(POINTS, COORDINATE, COORDINATE)
def test_histogram_equals_its_twin(points, x, y):
    # A spread that ends exactly on a sector's edge may differ by rounding, which adds nothing.
    fast = histogram(points, x, y, 0.02, 4.0, SECTORS)
    np.testing.assert_allclose(fast, slow_histogram(points, x, y, 0.02, 4.0), rtol=0, atol=1e3 * KERNEL)


@given(st.lists(st.booleans(), min_size=SECTORS, max_size=SECTORS))
def test_valleys_cover_the_free_sectors_and_no_others(blocked):
    covered = np.zeros(SECTORS, dtype=int)
    for first, length in valleys(np.array(blocked)):
        covered[(first + np.arange(length)) % SECTORS] += 1
        assert length == SECTORS or (blocked[first - 1] and blocked[(first + length) % SECTORS])
    np.testing.assert_array_equal(covered, ~np.array(blocked))


def arcs(draws):
    """A ring with a few blocked arcs."""
    blocked = np.zeros(SECTORS, dtype=bool)
    for first, length in draws:
        blocked[(first + np.arange(length)) % SECTORS] = True
    return blocked


ARCS = st.lists(st.tuples(st.integers(0, SECTORS - 1), st.integers(1, 40)), max_size=4).map(arcs)


@given(ARCS, st.floats(-3.14, 3.14))
def test_headings_equal_their_twin(blocked, goal):
    fast = headings(blocked, goal, NARROW, WIDE, NARROW)
    slow = slow_headings(blocked, goal, NARROW, WIDE, NARROW)
    assert len(fast) == len(slow)
    for heading in fast:
        assert min(abs(wrapped(heading - other)) for other in slow) < KERNEL


def test_a_heading_keeps_off_the_edges_of_a_wide_valley_and_takes_the_middle_of_a_narrow_one():
    blocked = np.ones(SECTORS, dtype=bool)
    blocked[60:100] = False  # bearings 0° to 120°
    assert headings(blocked, math.radians(60.0), NARROW, WIDE, NARROW) == pytest.approx([math.radians(60.0)])
    assert headings(blocked, math.radians(-20.0), NARROW, WIDE, NARROW) == pytest.approx([math.radians(36.0)])
    blocked[80:] = True  # to 60°
    assert headings(blocked, math.radians(-20.0), NARROW, WIDE, NARROW) == pytest.approx([math.radians(30.0)])
    blocked[71:] = True  # to 33°: less than 36°
    assert len(headings(blocked, 0.0, NARROW, WIDE, NARROW)) == 0


@given(st.integers(0, 10_000), st.integers(1, 2))
def test_search_finds_the_cheapest_of_all_ways(seed, depth):
    rng = np.random.default_rng(seed)
    bearings = rng.uniform(-math.pi, math.pi, rng.integers(0, 6))
    arc = np.linspace(-0.3, 0.3, 13)
    spread = (bearings[:, None] + arc * rng.uniform(0.2, 1.5, (len(bearings), 1))).ravel()
    ranges = np.repeat(rng.uniform(0.3, 2.0, len(bearings)), len(arc))
    points = np.column_stack((ranges * np.cos(spread), ranges * np.sin(spread)))
    unseen = np.abs(np.arange(SECTORS) - 59.5) > rng.choice([45, 60])
    goal, before = rng.uniform(-4, 4, 2), rng.uniform(-math.pi, math.pi)
    costs = COSTS._replace(depth=depth)
    heading, found = search(points, unseen, goal, before, 0.06, RULES, costs)
    ways = slow_paths(points, unseen, goal, 0.06, RULES, costs, 0.0, 0.0, before, 0, 0.0, None)
    deepest = max(way[0] for way in ways)
    assert found == (deepest > 0)
    if found:
        reach = [way for way in ways if way[0] == deepest]
        least = min(cost for _, cost, _ in reach)
        best = [first for _, cost, first in reach if cost < least + 1e-6]
        assert min(abs(wrapped(heading - first)) for first in best) < 1e-6


@given(POINTS, st.floats(0.1, 3.0))
def test_nearest_ahead_equals_its_twin(points, half_angle):
    sides = [math.inf, math.inf]
    for x, y in points:
        if abs(abs(math.atan2(y, x)) - half_angle) < 1e-6:
            return
        if abs(math.atan2(y, x)) <= half_angle or x == y == 0.0:
            for side, there in enumerate((y >= 0.0, y <= 0.0)):
                sides[side] = min(sides[side], math.hypot(x, y)) if there else sides[side]
    assert nearest_ahead(points, half_angle) == pytest.approx(sides, abs=KERNEL)


@given(POINTS, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_least_clearance_equals_its_twin(points, v, omega):
    box, time = (0.2, 0.15, 0.02), 0.3

    def clearance(x, y, yaw):
        least = math.inf
        for px, py in points - (x, y):
            along = math.cos(yaw) * px + math.sin(yaw) * py
            across = math.cos(yaw) * py - math.sin(yaw) * px
            corner = (np.clip(along, -box[0], box[0]), np.clip(across, -box[1], box[1]))
            least = min(least, math.dist((along, across), corner) - box[2])
        return least

    now, least = least_clearance(points, box, v, omega, time)
    assert now == pytest.approx(clearance(0.0, 0.0, 0.0), abs=KERNEL)
    radius = v / omega if abs(omega) > 1e-3 else None
    along_arc = []
    for t in np.linspace(0.0, time, 40):
        yaw = omega * t
        chord = 2 * radius * math.sin(yaw / 2) if radius is not None else v * t
        along_arc.append(clearance(chord * math.cos(yaw / 2), chord * math.sin(yaw / 2), yaw))
    assert least == pytest.approx(min(along_arc), abs=0.02)


# --- fuzzy curves -----------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.floats(-1.0, 5.0), st.booleans())
def test_fuzzy_curve_equals_mamdani_inference(value, falling):
    inputs, outputs = np.linspace(0.0, 4.0, 5), np.linspace(0.0, 0.7, 5)
    if falling:
        outputs = outputs[::-1]
    assert FuzzyCurve(inputs, outputs)(value) == pytest.approx(slow_curve(value, inputs, outputs), abs=1e-3)


def test_fuzzy_curve_reaches_the_middle_of_the_outermost_halves():
    # A half triangle from 0.525 to 0.7 has its centroid two thirds up.
    curve = FuzzyCurve(np.linspace(0.0, 4.0, 5), np.linspace(0.7, 0.0, 5))
    assert curve(0.0) == pytest.approx(0.525 + 0.175 * 2 / 3, abs=1e-4)
    assert curve(4.0) == pytest.approx(0.175 / 3, abs=1e-4)
    assert curve(2.0) == pytest.approx(0.35, abs=1e-4)
    assert curve(9.0) == curve(4.0)


# --- the planner ------------------------------------------------------------------------------------------


def planner(robot, **config):
    made = S3Fisvfh(load_settings("planner/s3_fisvfh", **config), robot)
    made.reset(np.random.default_rng(0))
    return made


def as_run(robot):
    made = S3Fisvfh(load_settings("planner/s3_fisvfh_as_run"), robot)
    made.reset(np.random.default_rng(0))
    return made


def ranges_of(robot, fill=np.inf, **arcs_deg):
    """Beams of one range, and over arcs {name: (low, high, range)} of another."""
    lidar = robot.lidar
    ranges = np.full(lidar.num_beams, fill, dtype=np.float32)
    degrees = np.degrees(lidar.angle_min + lidar.angle_increment * np.arange(lidar.num_beams))
    for low, high, value in arcs_deg.values():
        ranges[(degrees > low) & (degrees < high)] = value
    return ranges


def plan(robot, target=(5.0, 0.0), ranges=None, twist=Twist(0.0, 0.0), **config):  # noqa: B008
    view = observation(target=target, ranges=ranges, twist=twist, robot=robot)
    return planner(robot, **config).plan(view, Guidance(view.target))


def drive(robot, goal, world=None, **changes):
    made = S3Fisvfh(load_settings("planner/s3_fisvfh"), robot)
    return drives.drive(made, robot, world, goal=goal, **changes)


def test_full_speed_only_where_all_is_clear_and_the_goal_lies_ahead():
    jackal = shipped("jackal")
    assert plan(jackal, ranges=ranges_of(jackal)).v == pytest.approx(2.0)
    slow = 0.7 * 11 / 12  # less what the centroid of a half set loses
    side = ranges_of(jackal, wall=(10.0, 60.0, 3.5))
    assert plan(jackal, ranges=side).v == pytest.approx(slow, abs=1e-3)
    assert plan(jackal, ranges=ranges_of(jackal, wall=(25.0, 60.0, 3.5))).v == pytest.approx(2.0)
    full = ranges_of(jackal, wall=(-40.0, 40.0, 2.055))  # 2 m in every sector ahead
    assert plan(jackal, ranges=full, block_distance=0.5).v == pytest.approx(0.35, abs=0.02)


def test_s3_fisvfh_turns_towards_the_goal_as_the_rules_say():
    jackal = shipped("jackal")
    for degrees, wanted in ((0.0, 0.0), (67.5, math.pi / 2), (-67.5, -math.pi / 2)):
        bearing = math.radians(degrees)
        target = (5 * math.cos(bearing), 5 * math.sin(bearing))
        command = plan(jackal, target, ranges_of(jackal))
        assert command.omega == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize(("near", "sign"), [((5.0, 30.0, 0.4), -1), ((-30.0, -5.0, 0.4), 1)])
def test_the_safeguard_backs_up_over_covered_ground_and_turns_to_the_clearer_side(near, sign):
    jackal = shipped("jackal")
    made = planner(jackal)
    free = observation(ranges=ranges_of(jackal), robot=jackal)
    made.plan(free, Guidance(free.target))
    blocked = observation(ranges=ranges_of(jackal, near=near), robot=jackal, odometry=Pose(0.3, 0.0, 0.0))
    command = made.plan(blocked, Guidance(blocked.target))
    assert command.v == pytest.approx(-0.4)
    assert command.omega == pytest.approx(0.5 * sign)


def test_the_safeguard_turns_on_the_spot_where_the_robot_has_not_been():
    jackal = shipped("jackal")
    command = plan(jackal, ranges=ranges_of(jackal, near=(5.0, 30.0, 0.4)))
    assert command == (0.0, pytest.approx(-0.5))


@pytest.mark.parametrize(("near", "sign"), [((5.0, 30.0, 0.4), -1), ((-30.0, -5.0, 0.4), 1)])
def test_as_run_the_safeguard_backs_up_where_the_robot_has_not_been(near, sign):
    """Also with an obstacle behind, which the lidar sees at ±120°."""
    jackal = shipped("jackal")
    ranges = ranges_of(jackal, near=near, left=(115.0, 135.0, 0.3), right=(-135.0, -115.0, 0.3))
    view = observation(ranges=ranges, robot=jackal)
    command = as_run(jackal).plan(view, Guidance(view.target))
    assert command == (pytest.approx(-0.4), pytest.approx(0.5 * sign))


def test_as_run_a_command_into_contact_is_given():
    """A post beside the left wheel, out of the guarded arc: a turn to the right swings the corner into it."""
    jackal = shipped("jackal")
    ranges = ranges_of(jackal, post=(84.0, 90.0, 0.165))
    view = observation(target=(0.5, -5.0), ranges=ranges, twist=Twist(0.0, -2.0), robot=jackal)
    command, checked = (
        as_run(jackal).plan(view, Guidance(view.target)),
        plan(jackal, view.target, ranges, view.twist),
    )
    assert command.v > 0.0
    assert command.omega < -1.0
    assert checked != command


def test_as_run_the_search_reads_the_histogram_once():
    """One step of the search is equivalent to both steps of the entry."""
    assert load_settings("planner/s3_fisvfh_as_run").depth == 1


def test_headings_are_smoothed_alike_at_any_control_rate():
    target = np.array([0.0, 6.0])
    turned = {}
    for rate in (10.0, 5.0):
        robot = stage(control_rate=rate, alpha_omega=100.0)
        made = planner(robot)
        ahead = observation(ranges=ranges_of(robot), robot=robot, target=(6.0, 0.0))
        made.plan(ahead, Guidance(ahead.target))
        for _ in range(round(rate * 0.2)):
            left = observation(ranges=ranges_of(robot), robot=robot, target=target)
            command = made.plan(left, Guidance(target))
        turned[rate] = command.omega
    assert turned[5.0] == pytest.approx(turned[10.0], abs=KERNEL)
    settled = plan(stage(alpha_omega=100.0), target, ranges_of(stage())).omega
    assert turned[5.0] < 0.96 * settled  # two halvings: three quarters of the way to 90°


@pytest.mark.parametrize("name", SHIPPED)
@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
@example(seed=178)  # ties: headings straight behind, and sides equally clear but for rounding
@example(seed=201)
@example(seed=722)
@example(seed=1100)
def test_a_mirrored_scene_mirrors_the_command(name, seed):
    robot = shipped(name)
    rng, count = np.random.default_rng(seed), robot.lidar.num_beams
    ranges = np.repeat(rng.uniform(0.3, 6.0, 30), count // 30 + 1)[:count].astype(np.float32)
    mirror = (-np.arange(count)) % count if robot.lidar.full_circle else np.arange(count)[::-1]
    x, y = rng.uniform(-5, 5, 2)
    v, omega = rng.uniform(-1, 1) * robot.v_max, rng.uniform(-1, 1) * robot.omega_max
    one = plan(robot, (x, y), ranges, Twist(v, omega))
    other = plan(robot, (x, -y), ranges[mirror], Twist(v, -omega))
    assert (other.v, -other.omega) == pytest.approx(tuple(one), abs=1e-6)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("goal", [(10.0, 0.0), (-4.0, 0.0), (0.0, -0.5), (-0.2, 0.05)])
def test_s3_fisvfh_comes_to_rest_at_the_goal(name, goal):
    trajectory = drive(shipped(name), goal, goal_tolerance=1e-9, time_limit=40.0).trajectory
    distance = np.hypot(trajectory[:, 1] - goal[0], trajectory[:, 2] - goal[1])
    arrived = int(np.argmax(distance < 0.2))
    assert distance[arrived:].max() < 0.21
    assert distance[-1] < 0.01
    if goal[1] == 0.0 and goal[0] > 0.0:
        assert np.abs(trajectory[:, 2]).max() < 0.01


def test_s3_fisvfh_goes_round_an_obstacle():
    episode = drive(shipped("jackal"), (6.0, 0.0), World(circles=np.array([[3.0, 0.1, 0.4]])))
    assert episode.outcome == Outcome.SUCCESS
    assert episode.min_clearance > 0.1
