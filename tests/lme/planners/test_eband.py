"""Elastic bands: bubbles are free space, forces do what they should, the robot follows and never rams."""

import dataclasses
import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.episode import run_episode
from lme.errors import InputError
from lme.geometry.frames import to_robot, to_world
from lme.guides.target import Target, TargetConfig
from lme.navigator import Navigator
from lme.planners.eband.band import Band
from lme.planners.eband.kernels import bubble_radii, covered, hidden, mend, relax
from lme.planners.eband.planner import EBand, EBandConfig, _thinned
from lme.planners.polyline import leaves, project, stretch
from lme.resources import resource_dir
from lme.sim.fast import FastConfig, FastSimulator
from lme.types import Guidance, Observation, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, room, shipped, stage, task
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
SHAPE = (0.15, 1.0, 0.05)  # inner disc, ceiling, spacing
FORCES = (1.0, 2.0, 0.55, 0.15)
JOINT = (0.7, 0.1)
NOTHING = np.empty((0, 2))


# Slow, obvious twins


def slow_radius(x, y, points):
    nearest = min((math.dist((x, y), point) for point in points), default=math.inf)
    return min(nearest - SHAPE[0], SHAPE[1])


def slow_force(before, bubble, after, points):
    """Quinlan & Khatib 1993: contraction and repulsion, without their part along the band; a vector."""
    centre, radius = np.array(bubble[:2]), bubble[2]
    along = after - before
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    internal, external, influence, _ = FORCES
    force = np.zeros(2)
    for neighbour in (before, after):
        force += internal * (neighbour - centre) / max(np.hypot(*(neighbour - centre)), 1e-9)
    if radius < influence:
        h = max(radius, SHAPE[2])
        slope = (
            slow_radius(*(centre + h * normal), points) - slow_radius(*(centre - h * normal), points)
        ) / (2 * h)
        force += external * (influence - radius) * slope * normal
    return force @ normal, normal


def slow_relax(centres, radii, points, iterations, recursion):
    centres, radii = centres.copy(), radii.copy()
    for _ in range(iterations):
        for i in range(1, len(centres) - 1):
            before, after = centres[i - 1].copy(), centres[i + 1].copy()
            if np.hypot(*(after - before)) < 1e-9:
                continue
            force, normal = slow_force(before, (*centres[i], radii[i]), after, points)
            if abs(force) < FORCES[3]:
                continue
            reach = max(radii[i], SHAPE[2])
            for halving in range(recursion + 1):
                moved = centres[i] + np.clip(reach * force / 2, -reach, reach) / 2**halving * normal
                bubble = (*moved, slow_radius(*moved, points))
                there, _ = slow_force(before, bubble, after, points)
                if there * force >= 0 or abs(there) <= 0.75 * abs(force):
                    break
            centres[i], radii[i] = moved, bubble[2]
    return centres, radii


def join(one, other):
    return min(one[2], other[2]) > JOINT[1] and math.dist(one[:2], other[:2]) <= JOINT[0] * (
        one[2] + other[2]
    )


def slow_mend(centres, radii, points):
    bubbles = [(*centre, radius) for centre, radius in zip(centres, radii, strict=True)]
    kept = [bubbles[0]]
    for bubble, following in zip(bubbles[1:], [*bubbles[2:], None], strict=True):
        if following is None or not join(kept[-1], following):
            kept.append(bubble)
    whole, joints = [kept[0]], []
    for bubble in kept[1:]:
        new, new_joints = between(whole[-1], bubble, points)
        whole += new
        joints += new_joints
    return np.array(whole), [*joints, False].index(False) + 1


def between(one, other, points):
    """Bubbles after `one` up to `other`, and whether each joins the one before it."""
    gap = math.dist(one[:2], other[:2])
    if join(one, other) or gap <= SHAPE[2]:
        return [other], [join(one, other) or min(one[2], other[2]) > JOINT[1]]
    middle = ((one[0] + other[0]) / 2, (one[1] + other[1]) / 2)
    middle = (*middle, slow_radius(*middle, points))
    first, second = between(one, middle, points), between(middle, other, points)
    return first[0] + second[0], first[1] + second[1]


def scene(seed):
    """A wavy band of a few bubbles, and points about it."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, rng.uniform(0.5, 3.0), int(rng.integers(2, 8)))
    centres = np.column_stack([x, rng.normal(0.0, 0.3, len(x))])
    points = rng.uniform((-1.0, -1.5), (4.0, 1.5), (int(rng.integers(0, 30)), 2))
    xs, ys = points.T.copy()
    return centres, points, xs, ys


@settings(max_examples=100)
@given(SEEDS)
def test_radii_equal_the_distance_to_the_nearest_point(seed):
    centres, points, xs, ys = scene(seed)
    expected = [slow_radius(*centre, points) for centre in centres]
    assert bubble_radii(centres, xs, ys, *SHAPE[:2]) == pytest.approx(expected, abs=KERNEL)


@settings(max_examples=100)
@given(SEEDS, st.integers(1, 3), st.integers(0, 4))
def test_relaxing_equals_the_forces_of_the_paper(seed, iterations, recursion):
    centres, points, xs, ys = scene(seed)
    radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
    expected = slow_relax(centres, radii, points, iterations, recursion)
    relax(centres, radii, xs, ys, SHAPE, FORCES, (iterations, recursion))
    assert centres == pytest.approx(
        expected[0], abs=1e3 * KERNEL
    )  # a tie may fall either way: the force is steep
    assert radii == pytest.approx(expected[1], abs=1e3 * KERNEL)


@settings(max_examples=100)
@given(SEEDS)
def test_mending_equals_its_recursive_twin(seed):
    centres, points, xs, ys = scene(seed)
    radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
    expected, chain = slow_mend(centres, radii, points)
    mended = mend(centres, radii, xs, ys, SHAPE, JOINT, 1024)
    assert np.column_stack(mended[:2]) == pytest.approx(expected, abs=KERNEL)
    assert mended[2] == chain


@settings(max_examples=100)
@given(SEEDS)
def test_the_disc_can_move_along_the_joined_part_of_a_band(seed):
    centres, points, xs, ys = scene(seed)
    for _ in range(3):
        radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
        relax(centres, radii, xs, ys, SHAPE, FORCES, (3, 4))
        centres, radii, chain = mend(centres, radii, xs, ys, SHAPE, JOINT, 256)
    for i in range(chain - 1):
        for part in np.linspace(0, 1, 11):
            assert slow_radius(*(part * centres[i] + (1 - part) * centres[i + 1]), points) > 0


def test_no_more_bubbles_than_there_is_room_for():
    wall = np.column_stack([np.ones(50), np.linspace(-1, 1, 50)])
    ends = np.array([[0.0, 0.0], [2.0, 0.0]])
    xs, ys = wall.T.copy()
    radii = bubble_radii(ends, xs, ys, *SHAPE[:2])
    centres, radii, chain = mend(ends, radii, xs, ys, SHAPE, JOINT, 10)
    assert len(centres) == len(radii) <= 10
    assert chain < len(centres)


def test_tension_straightens_and_obstacles_push_aside():
    bent = np.array([[0.0, 0.0], [0.5, 0.4], [1.0, 0.0]])
    relax(bent, np.ones(3), np.empty(0), np.empty(0), SHAPE, FORCES, (20, 4))
    assert abs(bent[1, 1]) < 0.1
    straight = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    near = np.array([0.5]), np.array([-0.25])
    radii = bubble_radii(straight, *near, *SHAPE[:2])
    relax(straight, radii, *near, SHAPE, FORCES, (3, 4))
    assert straight[1, 1] > 0.05
    assert straight[1, 0] == pytest.approx(0.5, abs=0.02)  # across the band, not along it
    assert straight[[0, 2]].tolist() == [[0.0, 0.0], [1.0, 0.0]]


@settings(max_examples=100)
@given(SEEDS)
def test_places_on_a_line_equal_dense_sampling(seed):
    rng = np.random.default_rng(seed)
    line = rng.uniform(-2, 2, (int(rng.integers(2, 6)), 2))
    lengths = np.hypot(*np.diff(line, axis=0).T)
    ticks = np.concatenate([[0], np.cumsum(lengths)])

    def at(along):
        return np.column_stack([np.interp(along, ticks, line[:, k]) for k in (0, 1)])

    dense = np.linspace(0, ticks[-1], 4001)
    x, y = rng.uniform(-2, 2, 2)
    gaps = np.hypot(*(at(dense) - (x, y)).T)
    along, off, segment = project(line, x, y)
    assert off == pytest.approx(gaps.min(), abs=1e-2)
    assert np.hypot(*(at([along])[0] - (x, y))) == pytest.approx(off, abs=KERNEL)
    assert ticks[segment] - KERNEL <= along <= ticks[segment + 1] + KERNEL
    begin, end = np.sort(rng.uniform(0, 1.2 * ticks[-1], 2))
    places = stretch(line, begin, end, 0.1)
    count = max(math.ceil((min(end, ticks[-1]) - begin) / 0.1 - 1e-9), 0)
    evenly = begin + (min(end, ticks[-1]) - begin) * np.arange(1, count + 1) / max(count, 1)
    assert places == pytest.approx(at(evenly), abs=KERNEL)
    radius = rng.uniform(0.1, 3)
    *out, length = leaves(line, radius)
    outside = np.flatnonzero(np.hypot(*(at(dense) - line[0]).T) > radius)
    expected = at(dense[outside[:1]])[0] if len(outside) else line[-1]
    assert length == pytest.approx(ticks[-1], abs=KERNEL)
    if len(outside):
        assert math.dist(out, line[0]) == pytest.approx(radius, abs=1e-6)
    assert math.dist(out, expected) < 0.05 * ticks[-1] or _grazes(at(dense), line[0], radius)


def _grazes(places, centre, radius):
    """The line only just leaves the disc, or comes back into it, between two samples."""
    gaps = np.hypot(*(places - centre).T) - radius
    return bool((np.abs(gaps) < 1e-2).any())


def test_covered_needs_every_point_in_a_bubble():
    centres, radii = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, -0.1])
    assert covered(np.array([[0.3, 0.3], [1.0, 0.04]]), centres, radii, 0.05)
    assert not covered(np.array([[0.3, 0.3], [1.0, 0.06]]), centres, radii, 0.05)
    assert covered(NOTHING, centres, radii, 0.05)


@settings(max_examples=200)
@given(SEEDS, st.booleans(), st.booleans())
def test_hidden_points_are_those_no_beam_reaches(seed, full, clockwise):
    rng = np.random.default_rng(seed)
    num_beams, increment = 36, math.radians(10.0) if full else math.radians(7.0)
    sign = -1 if clockwise else 1
    angle_min = -sign * increment * (num_beams - 1) / 2
    ranges = rng.uniform(0.0, 5.5, num_beams).astype(np.float32)
    ranges[rng.random(num_beams) < 0.1] = np.nan
    points = rng.uniform(-6, 6, (40, 2))
    found = hidden(points, ranges, (angle_min, sign * increment), (0.3, 5.0), 0.1)
    for (x, y), answer in zip(points, found, strict=True):
        bearings = angle_min + sign * increment * np.arange(num_beams)
        off = np.abs([math.remainder(math.atan2(y, x) - bearing, math.tau) for bearing in bearings])
        reading = ranges[off.argmin()]
        in_view = off.min() <= increment / 2 and reading >= 0.3
        assert answer == (not in_view or math.hypot(x, y) > min(reading + 0.1, 5.0))


# The band


def band(robot=None, **settings):
    return Band(EBandConfig(**settings), (robot or stage()).footprint.r_min)


def update(made, path, robot=(0.0, 0.0), points=NOTHING, planned=True, times=1):
    for _ in range(times):
        made.update(np.array(path, dtype=float), np.array(robot, dtype=float), points, planned=planned)
    return made


def poles(*places):
    """Points all round small poles."""
    ring = 0.05 * np.column_stack(
        [f(np.linspace(0, 2 * np.pi, 12, endpoint=False)) for f in (np.cos, np.sin)]
    )
    return np.vstack([np.array(place) + ring for place in places])


def test_a_band_goes_from_the_robot_to_the_path_s_end_within_the_horizon():
    made = update(band(horizon=2.0), [(0, 0), (1, 0), (5, 0)])
    assert made.centres[0].tolist() == [0.0, 0.0]
    assert made.centres[-1] == pytest.approx((2.0, 0.0), abs=KERNEL)
    update(made, [(0, 0), (1, 0), (5, 0)], robot=(0.5, 0.1))
    assert made.centres[0].tolist() == [0.5, 0.1]
    assert made.centres[-1] == pytest.approx((2.5, 0.0), abs=KERNEL)
    update(made, [(0, 0), (1, 0), (5, 0)], robot=(4.5, 0.0))
    assert made.centres[-1].tolist() == [5.0, 0.0]
    assert not made.torn


def test_a_band_keeps_to_the_middle_of_a_gap_that_the_path_grazes():
    points = poles((1.0, 0.6), (1.0, -0.2))  # 0.7 m between them, its middle at y = 0.2
    made = update(band(), [(0, 0), (2, 0)], points=points, times=30)
    assert not made.torn
    crossing = np.interp(1.0, *made.centres.T)
    assert crossing == pytest.approx(0.2, abs=0.07)


def test_a_band_stays_where_it_is_while_the_path_wavers():
    points = poles((1.0, 0.0))
    left, right = [(0, 0), (1, 0.6), (2, 0)], [(0, 0), (1, -0.6), (2, 0)]
    made = update(band(), left, points=points, times=3)
    for path in (right, left, right, right):
        update(made, path, points=points)
        assert np.interp(1.0, *made.centres.T) > 0.3
    blocked = np.vstack([points, poles(*[(1.0, y) for y in np.arange(0.1, 1.6, 0.1)])])
    update(made, right, points=blocked)  # torn now, ...
    update(made, right, points=blocked, times=3)  # ... so the next path counts
    assert not made.torn
    assert np.interp(1.0, *made.centres.T) < -0.3


def test_a_path_to_elsewhere_is_followed_at_once():
    made = update(band(), [(0, 0), (2, 0)])
    update(made, [(0, 0), (0, 2)])
    assert made.centres[-1].tolist() == [0.0, 2.0]


def test_an_end_that_moves_a_little_takes_the_band_s_end_along():
    made = update(band(), [(0, 0), (1.5, 0)])
    for end in ([1.5, 0.03], [1.46, 0.03]):
        update(made, [(0, 0), end])
        assert made.centres[-1].tolist() == end
    update(made, [(0, 0), (1.5, 0.4)])  # within the last bubble, but elsewhere
    assert made.centres[-1].tolist() == [1.5, 0.4]


def test_bubbles_that_the_robot_has_passed_are_gone():
    points = poles(*[(x, side * 0.45) for x in np.arange(-1.0, 3.0, 0.1) for side in (-1, 1)])
    path = [(0, 0), (5, 0)]
    made = update(band(), path, points=points)
    passed = (made.centres[:, 0] > 0) & (made.centres[:, 0] < 0.95)
    assert passed.sum() >= 2
    made.centres[1:3] += (0.0, 0.01)  # not quite redundant
    update(made, path, robot=(0.97, 0.0), points=points)
    assert (made.centres[1:, 0] > 0.97).all()


def test_a_gap_too_narrow_tears_the_band_just_there():
    wall = poles(*[(1.0, y) for y in np.arange(-2, 2.01, 0.1)])
    made = update(band(), [(0, 0), (2, 0)], points=wall)
    assert made.torn
    assert 0.5 < made.centres[made.chain - 1, 0] < 0.9


# The planner


def planner(robot=None, **settings):
    made = EBand(EBandConfig(**settings), robot or stage())
    made.reset(np.random.default_rng(0))
    return made


def drive(job, robot, navigator=None):
    navigator = navigator or Navigator(Target(TargetConfig(), robot), planner(robot))
    return run_episode(job, navigator, FastSimulator(FastConfig(), robot), np.random.default_rng(0))


@pytest.mark.parametrize("name", SHIPPED)
def test_it_keeps_to_the_line_and_stops_at_the_goal(name):
    robot = shipped(name)
    simulator, made = FastSimulator(FastConfig(), robot), planner(robot)
    view = simulator.reset(task(goal=(10.0, 0.0), goal_tolerance=1e-9), np.random.default_rng(0))
    xs, ys = [], []
    for _ in range(int(40 * robot.control_rate)):
        before = view.twist
        command = made.plan(view, Guidance(view.target))
        assert abs(command.v) <= robot.v_max + KERNEL
        assert abs(command.v - before.v) <= robot.alpha_v * robot.dt + KERNEL
        assert abs(command.omega) <= robot.omega_max + KERNEL
        assert abs(command.omega - before.omega) <= robot.alpha_omega * robot.dt + KERNEL
        view = simulator.step(command)
        xs.append(simulator.state.pose.x)
        ys.append(simulator.state.pose.y)
    assert np.abs(ys).max() < 0.05
    assert max(xs) < 10.05
    assert abs(xs[-1] - 10.0) < 0.05
    assert view.twist == pytest.approx((0.0, 0.0), abs=1e-3)


def test_it_turns_in_place_first_when_the_way_leads_back():
    command = planner().plan(observation(target=(-3.0, 1.0)), Guidance(np.array([-3.0, 1.0])))
    assert command.v == 0.0
    assert command.omega > 0.0


def test_small_bubbles_slow_it_down():
    # Walls 0.5 m to either side: a bubble of 0.3 m, 0.6 m/s at most; here the acceleration is no limit.
    robot = stage(v_max=2.0, alpha_v=50.0, num_beams=2000)
    world = World(segments=np.array([[-20.0, 0.5, 20.0, 0.5], [-20.0, -0.5, 20.0, -0.5]]))
    simulator = FastSimulator(FastConfig(), robot)
    view = simulator.reset(task(world, goal=(8.0, 0.0)), np.random.default_rng(0))
    assert planner(robot).plan(view, Guidance(view.target)).v == pytest.approx(0.6, abs=0.01)
    free = planner(robot).plan(observation(target=(8.0, 0.0), robot=robot), Guidance(view.target))
    assert free.v == pytest.approx(0.75, abs=KERNEL)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_sealed_box_ends_in_a_timeout(name):
    robot = shipped(name)
    job = task(room(2.0), goal=(5.0, 0.3), time_limit=20.0)
    assert drive(job, robot).outcome == Outcome.TIMEOUT


def test_it_follows_a_path_through_a_door_that_the_straight_line_misses():
    robot = shipped("jackal")
    wall = World(segments=np.array([[2.0, -4.0, 2.0, 0.6], [2.0, 1.4, 2.0, 4.0]]))
    corners = np.array([[0.0, 0.0], [1.2, 1.0], [2.8, 1.0], [4.0, 0.0]])

    class Doorman:
        def reset(self, rng):
            pass

        def guide(self, observation):
            rest = stretch(corners, project(corners, *observation.odometry[:2])[0], 99.0, 0.05)
            path = to_robot(np.vstack([np.array(observation.odometry[:2]), rest]), observation.odometry)
            return Guidance(path[-1], path)

    done = drive(task(wall), robot, Navigator(Doorman(), planner(robot)))
    assert done.outcome == Outcome.SUCCESS
    assert done.min_clearance > 0.1


def test_it_remembers_what_has_gone_out_of_sight():
    # A pole ahead, then half a turn: behind the robot, in the blind arc.
    robot = shipped("jackal")
    made = planner(robot)
    world = World(circles=np.array([[0.6, 0.0, 0.1]]))
    simulator = FastSimulator(FastConfig(), robot)
    for yaw in (0.0, math.pi, math.pi):
        view = simulator.reset(task(world, start=Pose(0.0, 0.0, yaw)), np.random.default_rng(0))
        odometry = Pose(0.0, 0.0, yaw)
        made.plan(view._replace(odometry=odometry), Guidance(view.target))
        nearest = np.hypot(*(made._known - (0.6, 0.0)).T).min()
        assert nearest == pytest.approx(0.1, abs=0.01)
    gone = simulator.reset(task(start=Pose(0.0, 0.0, 0.0)), np.random.default_rng(0))
    made.plan(gone, Guidance(gone.target))
    assert len(made._known) == 0  # seen through: no longer there


def test_what_it_remembers_does_not_grow_without_end():
    # Creeping along a corridor, 4 mm a step, every scan sees other points of what goes out of sight behind.
    robot = shipped("jackal")
    made, simulator = planner(robot), FastSimulator(FastConfig(), robot)
    walls = World(segments=np.array([[-9.0, 0.6, 9.0, 0.6], [-9.0, -0.6, 9.0, -0.6]]))
    view = simulator.reset(task(walls, goal=(50.0, 0.0)), np.random.default_rng(0))
    for _ in range(400):
        made.plan(view, Guidance(view.target))
        view = simulator.step(Twist(0.04, 0.0))
    behind = made._known[made._known[:, 0] < simulator.state.pose.x - 0.8]
    assert 0 < len(behind) <= 2 * 2 * 3.3 / 0.05  # two walls, two squares wide, as far as it looks


@given(SEEDS)
def test_thinning_leaves_one_point_per_square_whatever_the_order(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.2, 0.2, (int(rng.integers(0, 60)), 2))
    thin = _thinned(points, 0.05)
    squares = {tuple(square) for square in np.rint(points / 0.05)}
    assert {tuple(square) for square in np.rint(thin / 0.05)} == squares
    assert len(thin) == len(squares)
    np.testing.assert_array_equal(_thinned(rng.permutation(points), 0.05), thin)
    np.testing.assert_array_equal(np.sort(-_thinned(-points, 0.05), axis=0), np.sort(thin, axis=0))


def mirrored(view: Observation) -> Observation:
    pose = view.odometry
    return view._replace(
        scan=view.scan._replace(ranges=view.scan.ranges[::-1].copy()),
        target=view.target * (1.0, -1.0),
        twist=Twist(view.twist.v, -view.twist.omega),
        odometry=Pose(pose.x, -pose.y, -pose.yaw),
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_mirrored_drive_mirrors(seed):
    # 271 beams: symmetric about ahead, as a full circle that starts at −π is not.
    robot = stage(fov=math.radians(270.0), num_beams=271)
    rng = np.random.default_rng(seed)
    circles = np.column_stack([rng.uniform((0.8, -1.5), (6.0, 1.5), (12, 2)), np.full(12, 0.15)])
    simulator, one, other = FastSimulator(FastConfig(), robot), planner(robot), planner(robot)
    view = simulator.reset(task(World(circles=circles), goal=(6.0, 0.7)), np.random.default_rng(0))
    for _ in range(60):
        flipped = mirrored(view)
        command = one.plan(view, Guidance(view.target))
        again = other.plan(flipped, Guidance(flipped.target))
        assert again == pytest.approx((command.v, -command.omega), abs=1e-6)
        view = simulator.step(command)


def test_the_same_twice():
    robot = shipped("jackal")
    world = World(circles=np.array([[1.5, 0.3, 0.2], [2.5, -0.5, 0.3]]))
    one, two = drive(task(world), robot), drive(task(world), robot)
    np.testing.assert_array_equal(one.trajectory, two.trajectory)
    shared = Navigator(Target(TargetConfig(), robot), planner(robot))
    drive(task(room(3.0), goal=(5.0, 0.0), time_limit=3.0), robot, shared)
    np.testing.assert_array_equal(
        drive(task(world), robot, shared).trajectory, one.trajectory
    )  # reset forgets


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("fill", ["max", 0.0, math.nan, math.inf, -math.inf, 0.3, "mixed"])
@pytest.mark.parametrize("target", [(4.0, 1.0), (0.0, 0.0), (1e-9, -1e-9), (-2.0, 0.0)])
def test_any_scan_and_target_give_a_finite_command(name, fill, target):
    robot = shipped(name)
    lidar = robot.lidar
    ranges = np.full(lidar.num_beams, 1.0 if isinstance(fill, str) else fill, np.float32)
    if fill == "max":
        ranges[:] = lidar.range_max
    if fill == "mixed":
        ranges[::3], ranges[1::3] = np.nan, 0.05
    made = planner(robot)
    for odometry in (Pose(0.0, 0.0, 0.0), Pose(0.1, 0.0, 1.0), Pose(0.1, 0.1, -3.0)):
        view = observation(target=target, ranges=ranges, robot=robot, odometry=odometry)
        for path in (None, np.array([[0.0, 0.0]]), np.array([[0.0, 0.0], target, target])):
            command = made.plan(view, Guidance(view.target, path))
            assert math.isfinite(command.v)
            assert math.isfinite(command.omega)


def test_at_the_target_it_stands_still():
    assert planner().plan(observation(target=(0.0, 0.0)), Guidance(np.zeros(2))) == Twist(0.0, 0.0)


@pytest.mark.parametrize("start", [Pose(0.0, 0.0, 0.0), Pose(0.02, 0.01, 0.05), Pose(0.0, 0.05, 0.0)])
@pytest.mark.parametrize(("side", "least"), [(0.84, 0.0), (1.0, 0.05)])
def test_noise_does_not_grind_a_long_robot_into_the_walls(start, side, least):
    # 0.70 m long, 0.77 m corner to corner, 0.02 m of noise, and nowhere to go for a minute.
    robot = shipped("go2")
    done = drive(task(room(side), start=start, goal=(5.0, 0.0), time_limit=60.0), robot)
    assert done.outcome == Outcome.TIMEOUT
    assert done.min_clearance > least


def test_the_yaml_is_the_default_config():
    values = yaml.safe_load((resource_dir("conf") / "planner" / "eband.yaml").read_text("utf-8"))
    assert values.pop("_target_") == "lme.planners.eband.EBand"
    assert values == dataclasses.asdict(EBandConfig())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("horizon", 0.0),
        ("spacing", -1.0),
        ("max_radius", math.nan),
        ("min_radius", 1.5),
        ("overlap", 1.1),
        ("external_gain", -0.1),
        ("iterations", 0),
        ("recursion", -1),
        ("v_max", 0.0),
        ("v_min", -0.1),
        ("v_min", 0.8),
        ("rotation_threshold", math.inf),
        ("margin", -0.01),
    ],
)
def test_bad_settings_are_named(key, value):
    with pytest.raises(InputError, match=rf"planner\.{key} is {value:g}"):
        EBandConfig(**{key: value})


def test_the_band_lives_in_the_odometry_frame():
    # The same scene from another pose of the base: the band stays where it is.
    made = planner()
    goal = np.array([3.0, 1.0])
    made.plan(observation(target=goal), Guidance(goal))
    before = made.band.centres[-1].copy()
    here = Pose(0.1, 0.05, 0.3)
    moved = to_robot(goal, here)
    made.plan(observation(target=moved, odometry=here), Guidance(moved))
    assert made.band.centres[0] == pytest.approx(here[:2], abs=KERNEL)
    assert math.dist(before, made.band.centres[-1]) < 0.2
    assert to_world(moved, here) == pytest.approx(goal, abs=KERNEL)
