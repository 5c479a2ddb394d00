import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.navigation.episode import run_episode
from lme.perception.point_cloud import Projection, to_scan
from lme.simulation.fast import FastSimulator
from lme.simulation.mid360.sensor import ExtrudedWorld, Mid360, Mid360Config
from lme.types import Outcome
from lme.worlds.world import World
from tests.builders import navigator, shipped, task

LEVEL = [0.0, 0.0, 0.4, 0.0, 0.0, 0.0]
NOSE_DOWN = [0.1, 0.0, 0.4, 0.0, 0.35, 0.0]
BODY = Projection(min_height=0.1, max_height=0.6, range_min=0.1, range_max=20.0)


def square(x, y, half=0.25):
    return np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])


class ThroughTheCloud:
    """The fast simulator, its scans replaced by those of the cloud."""

    def __init__(self, robot, scene, mount, projection):
        self._fast = FastSimulator(load_settings("sim/fast"), robot)
        self._scene, self._mount, self._projection, self._dt = scene, mount, projection, robot.dt
        self._eyes = Mid360(Mid360Config(mount=mount))

    @property
    def state(self):
        return self._fast.state

    def reset(self, task, rng):
        simulator_rng, sensor_rng = rng.spawn(2)
        self._eyes.reset(sensor_rng)
        return self._seen(self._fast.reset(task, simulator_rng))

    def step(self, command):
        return self._seen(self._fast.step(command))

    def _seen(self, observation):
        cloud = self._eyes.cloud(self._scene, self.state.pose, self._dt)
        return observation._replace(scan=to_scan(cloud, self._projection, self._mount))


SOLID = (square(3.0, 0.0, 0.6), np.array([[4.8, -2.0], [5.0, -2.0], [5.0, 0.6], [4.8, 0.6]]))
LOW = square(5.6, 1.5, 0.3)  # 0.3 m high, beside the way round the wall
OVERHANG = np.array([[1.0, -4.5], [1.6, -4.5], [1.6, 4.5], [1.0, 4.5]])  # a beam from wall to wall


def drive(mount, projection, seed):
    """LME on the quadruped, past boxes and walls, low things, and under a beam, by what the cloud says."""
    robot = shipped("go2")
    walls = square(3.0, 0.0, 4.5)
    touchable = World(polygons=(walls, *SOLID, LOW))
    scene = ExtrudedWorld(
        World(polygons=(walls, *SOLID, LOW, OVERHANG)),
        polygons=[(0.0, 2.5), (0.0, 1.2), (0.0, 1.2), (0.0, 0.3), (0.7, 1.2)],
        ceiling=2.5,
    )
    problem = task(touchable, goal=(6.8, 0.0), goal_tolerance=0.3, time_limit=45.0)
    simulator = ThroughTheCloud(robot, scene, mount, projection)
    guide = navigator(robot, surmount="hidden")  # it keeps off the ends that the cloud shows late
    return run_episode(problem, guide, simulator, np.random.default_rng(seed))


@pytest.mark.parametrize("mount", [LEVEL, NOSE_DOWN], ids=["level", "nose down"])
def test_lme_reaches_the_goal_by_the_cloud_alone(mount):
    assert drive(mount, BODY, seed=0).outcome is Outcome.SUCCESS


def test_lme_does_not_reach_the_goal_where_an_overhang_counts_as_a_wall():
    all_heights = Projection(min_height=0.1, max_height=1.3, range_min=0.1, range_max=20.0)
    assert drive(LEVEL, all_heights, seed=0).outcome is Outcome.TIMEOUT


def test_lme_runs_into_low_obstacles_that_the_scan_leaves_out():
    high = Projection(min_height=0.35, max_height=0.6, range_min=0.1, range_max=20.0)
    assert drive(LEVEL, high, seed=0).outcome is Outcome.COLLISION
