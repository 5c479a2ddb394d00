"""LME as a behaviour of an ir-sim robot."""

import math

import numpy as np
import pytest
import yaml

import lme
from lme.errors import InputError
from tests.integration_scripts import load

irsim = pytest.importorskip("irsim")
behavior, table = load("lme_behavior"), load("irsim_table")
WORLD = yaml.safe_load(table.WORLD.read_text(encoding="utf-8"))


def environment(tmp_path, seed=0, obstacle=None, **robot):
    """An environment without a window; the world of the README with other obstacles or another robot."""
    content = {**WORLD, "robot": {**WORLD["robot"], **robot}}
    if obstacle is not None:
        content["obstacle"] = obstacle
    path = tmp_path / "world.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return irsim.make(str(path), headless=True, seed=seed, log_level="ERROR")


def test_the_robot_has_the_outline_limits_and_lidar_of_the_world_file(tmp_path):
    robot = behavior.robot_of(environment(tmp_path).robot)
    assert robot.footprint == lme.Footprint(radius=0.25)
    assert robot.limits == lme.Limits(1.0, 1.5, 2.0, 4.0, -1.0)
    assert (robot.control_rate, robot.lidar.num_beams, robot.lidar.range_max) == (10.0, 180, 8.0)
    assert robot.lidar.full_circle


def test_a_rectangle_stays_one_and_a_limit_that_is_not_given_lets_it_turn_about_at_once(tmp_path):
    shape = {"name": "rectangle", "length": 0.6, "width": 0.4}
    ego = environment(tmp_path, shape=shape, acce=[math.inf, math.inf], vel_min=[0, -1.5]).robot
    robot = behavior.robot_of(ego)
    assert robot.footprint == lme.Footprint(length=0.6, width=0.4)
    assert robot.limits == lme.Limits(1.0, 1.5, 20.0, 30.0, 0.0)


def test_the_scan_is_that_of_our_ray_caster_and_the_target_is_in_the_robots_frame(tmp_path):
    disc = {"shape": {"name": "circle", "radius": 0.5}, "state": [4, 12, 0]}
    ego = environment(tmp_path, obstacle=[disc], state=[2, 10, math.pi / 2], goal=[2, 15, 0]).robot
    seen = behavior.observe(ego, behavior.robot_of(ego))
    expected = lme.cast(behavior.robot_of(ego).lidar, lme.Pose(2.0, 10.0, math.pi / 2), [[4.0, 12.0, 0.5]])
    hit = np.isfinite(seen.scan.ranges)
    assert hit.sum() == pytest.approx((expected.ranges < 8.0).sum(), abs=1)  # a disc is a polygon in ir-sim
    both = hit & (expected.ranges < 8.0)
    assert both.sum() >= 8
    assert seen.scan.ranges[both] == pytest.approx(expected.ranges[both], abs=0.05)
    assert seen.target == pytest.approx([5.0, 0.0])
    assert seen.odometry == pytest.approx((2.0, 10.0, math.pi / 2))


def test_lme_plus_arrives_where_dash_collides():
    assert [table.drive(table.BEHAVIORS[name], 1)[0] for name in ("LME+", "ir-sim `dash`")] == [
        "success",
        "collision",
    ]


def test_a_reset_environment_repeats_the_drive(tmp_path):
    env, ends = environment(tmp_path, seed=1), []
    for _ in range(2):
        for _ in range(30):
            env.step()
        ends.append(env.robot.state.copy())
        env.reset()
    np.testing.assert_array_equal(*ends)


def test_a_robot_without_a_lidar_is_reported_in_one_line(tmp_path):
    env = environment(tmp_path, sensors=[])
    with pytest.raises(InputError, match=r"robot_0 has no lidar: add `sensors: \[\{name: lidar2d, …\}\]`"):
        env.step()


def test_an_unknown_system_is_reported_in_one_line(tmp_path):
    env = environment(tmp_path, behavior={"name": "lme", "system": "lme_pluss"})
    with pytest.raises(InputError, match="system is 'lme_pluss': did you mean lme_plus"):
        env.step()
