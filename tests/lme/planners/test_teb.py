"""TEB: it follows paths, keeps limits and its distance, stops where it would touch, and drives."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.teb.planner import Teb
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import observation, room, shipped
from tests.lme.planners.drives import drive, plan
from tests.tolerances import KERNEL

JACKAL = shipped("jackal")


def planner(robot=JACKAL, **changes):
    made = Teb(load_settings("planner/teb", **changes), robot)
    made.reset(np.random.default_rng(0))
    return made


def test_it_drives_at_its_own_speed():
    episode = drive(planner(), JACKAL, goal=(6.0, 1.0), goal_tolerance=0.3)
    assert episode.outcome is Outcome.SUCCESS
    assert episode.trajectory[:, 4].max() <= 0.8 + KERNEL
    assert np.median(episode.trajectory[:, 4]) == pytest.approx(0.8, abs=0.01)


def test_it_drives_around_posts_with_room_to_spare():
    posts = np.array([[2.0, 0.15, 0.2], [3.5, -0.3, 0.2]])
    episode = drive(planner(), JACKAL, World(circles=posts), goal_tolerance=0.3)
    assert episode.outcome is Outcome.SUCCESS
    track = episode.trajectory[:, 1:3]
    for x, y, radius in posts:
        assert np.hypot(*(track - [x, y]).T).min() > radius + JACKAL.footprint.inscribed_radius + 0.05


def test_it_follows_a_path_that_leads_back():
    made = planner()
    path = np.column_stack([-np.arange(0.0, 3.0, 0.05), 0.02 * np.ones(60)])
    command = None
    for _ in range(10):
        command = made.plan(observation(target=(-4.0, 0.0), robot=JACKAL), Guidance(path[-1], path))
    assert abs(command.omega) > 0.3  # it turns round


def test_a_band_that_touches_stops_the_robot_and_is_forgotten(monkeypatch):
    made, moving = planner(), observation(twist=Twist(0.4, 0.0), robot=JACKAL)
    monkeypatch.setattr(made.costmap, "outline_cost", lambda pose: -1 if pose.x > 0.1 else 0)
    assert plan(made, moving) == Twist(0.0, 0.0)
    assert len(made.band.poses) == 0
    monkeypatch.undo()
    assert plan(made, moving).v > 0.4
    assert made.band.poses[-1, 0] <= 1.5 + KERNEL  # half the horizon


def test_it_also_looks_between_two_poses(monkeypatch):
    made = planner()
    made.band.poses = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.7, 0.0, 0.0]])
    monkeypatch.setattr(made.costmap, "outline_cost", lambda pose: -1 if 0.1 < pose.x < 0.3 else 0)
    assert not made._free()
    monkeypatch.setattr(made.costmap, "outline_cost", lambda pose: -1 if pose.x > 0.75 else 0)
    assert made._free()


def test_errors_beyond_the_limit_are_a_divergence():
    view = observation(robot=JACKAL)
    assert plan(planner(), view).v > 0.0
    assert plan(planner(divergence_detection_max_chi_squared=0.1), view) == Twist(0.0, 0.0)


def test_obstacles_far_behind_are_ignored():
    made = planner()
    plan(made, observation(ranges=np.full(JACKAL.lidar.num_beams, 1.0, np.float32), robot=JACKAL))
    points = made._obstacles(Pose(0.0, 0.0, 0.0))
    assert len(points) > 20
    assert points[:, 0].min() >= -0.15
    assert made._obstacles(Pose(0.0, 0.0, np.pi))[:, 0].max() <= 0.15


def test_it_never_backs_up_with_the_values_of_the_entry():
    episode = drive(planner(), JACKAL, room(2.0), goal=(-5.0, 0.3), time_limit=8.0)
    assert episode.outcome is Outcome.TIMEOUT
    assert episode.trajectory[:, 4].min() >= -KERNEL


def test_near_the_target_it_stops():
    made = planner()
    view = observation(target=(0.05, 0.05), twist=Twist(0.3, 0.1), odometry=Pose(1.0, 2.0, 0.3), robot=JACKAL)
    assert plan(made, view) == Twist(0.0, 0.0)
