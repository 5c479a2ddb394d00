"""The environment of one robot: Gymnasium's rules, and what it says of the simulator."""

import warnings

import numpy as np
import pytest

gym = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from lme.config.presets import load_map_set, load_robot, load_simulator  # noqa: E402
from lme.errors import InputError  # noqa: E402
from lme.gym.envs import NavigationEnv  # noqa: E402
from lme.perception.people.source import people_source  # noqa: E402
from lme.types import Twist  # noqa: E402

STILL, AHEAD = np.zeros(2, np.float32), np.array([1.0, 0.0], np.float32)
MANY = {"subset": "official50"}


def drive(env, action=AHEAD, **reset):
    """Drive to the end of an episode: steps, rewards and the last info."""
    env.reset(**reset)
    rewards, info = [], {}
    while not info:
        _, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
    assert terminated != truncated
    return rewards, info


@pytest.mark.parametrize(
    ("env_id", "keywords"),
    [
        ("Barn", {}),
        ("Barn", {"sim": "skid"}),
        ("Barn", {"sim_config": {"latency": 0.1, "slip": 0.1, "scan_dropout": 0.1, "goal_noise": 0.1}}),
        ("Env1", {}),
        ("Env2", {"sim": "physics"}),
        ("Dynabarn", {"map_config": {"difficulty": "hard"}}),
        ("Social", {"map_config": {"kind": "crossing"}, "people": "tracked"}),
        ("Traps", {"map_config": {"kind": "door"}}),
        ("Real1Dynamic", {}),
        ("Go2B", {}),
    ],
)
def test_gymnasiums_checker_has_no_complaint(env_id, keywords):
    env = gym.make(f"lme:lme/{env_id}-v0", render_mode="rgb_array", **keywords)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*A Box observation space m(in|ax)imum value is -?infinity")
        check_env(env.unwrapped)
    env.close()


def test_a_seed_gives_the_same_episodes_again():
    one, other = (NavigationEnv(map_config=MANY) for _ in range(2))
    for seed in (7, None, None):
        seen, info = one.reset(seed=seed)
        again, same = other.reset(seed=seed)
        assert info == same
        for _ in range(5):
            np.testing.assert_equal(seen, again)
            seen, again = one.step(AHEAD)[0], other.step(AHEAD)[0]
    assert one.reset(seed=8)[1] != one.reset(seed=7)[1]


def test_the_observation_is_the_simulators():
    env, robot = NavigationEnv(robot="jackal", map_config=MANY), load_robot("jackal")
    rng = np.random.default_rng(3)
    seen, info = env.reset(seed=3)
    cls, config = load_simulator("fast")
    simulator, task = cls(config, robot), load_map_set("barn", MANY).task(info["world"])
    rng.integers(50)  # the draw of the world
    expected = simulator.reset(task, rng)
    for _ in range(4):
        np.testing.assert_array_equal(seen["scan"], expected.scan.ranges)
        np.testing.assert_array_equal(seen["target"], expected.target.astype(np.float32))
        np.testing.assert_array_equal(seen["twist"], np.float32(expected.twist))
        np.testing.assert_array_equal(seen["limits"], np.float32(robot.limits[:4]))
        seen, *_ = env.step(np.array([0.25, -0.5]))
        expected = simulator.step(Twist(0.25 * robot.v_max, -0.5 * robot.omega_max))


@pytest.mark.parametrize("people", ["truth", "tracked"])
def test_people_are_those_of_the_simulator_or_of_the_tracker(people):
    worlds = {"difficulty": "hard", "worlds": [3]}
    env, robot = NavigationEnv("dynabarn", map_config=worlds, people=people), load_robot("jackal")
    assert set(NavigationEnv("dynabarn", map_config=worlds).reset(seed=2)[0]) == set(
        env.observation_space
    ) - {"people"}
    seen, info = env.reset(seed=2)
    rng = np.random.default_rng(2)
    cls, config = load_simulator("fast")
    simulator, task = cls(config, robot), load_map_set("dynabarn", worlds).task(info["world"])
    rng.integers(1)  # the draw of the world
    expected, source = simulator.reset(task, rng), people_source(people, robot)
    counts = set()
    for _ in range(12):
        told = (source.seen(expected, None) if source else expected).pedestrians
        rows = seen["people"]
        assert env.observation_space["people"].contains(rows)
        counts.add(int(rows[:, 4].sum()))
        assert rows[:, 4].sum() == min(len(told), len(rows))
        away = np.hypot(rows[:, 0], rows[:, 1])[rows[:, 4] > 0.0]
        assert (np.diff(away) >= 0.0).all()
        assert {tuple(row) for row in rows[rows[:, 4] > 0.0, :4]} <= {tuple(row) for row in np.float32(told)}
        assert not rows[rows[:, 4] == 0.0].any()
        seen, *_ = env.step(np.array([0.25, 0.0]))
        expected = simulator.step(Twist(0.25 * robot.v_max, 0.0))
    assert max(counts) > 1


def test_an_action_beyond_one_is_cut_off():
    env, other = NavigationEnv(map_config=MANY), NavigationEnv(map_config=MANY)
    env.reset(seed=0), other.reset(seed=0)
    for _ in range(3):
        np.testing.assert_equal(env.step([7.0, -3.0])[0], other.step([1.0, -1.0])[0])


def test_an_arrival_is_rewarded_and_described():
    near = {"worlds": [0], "goal": [-2.25, 5.0], "goal_tolerance": 0.5}
    rewards, info = drive(NavigationEnv(map_config=near), seed=0)
    assert info["outcome"] == "success"
    assert info["is_success"] is True
    assert info["world"] == 0
    assert info["steps"] == len(rewards)
    assert info["optimal_time"] > 0.0
    assert info["barn_metric"] == pytest.approx(
        info["optimal_time"] / np.clip(info["time"], 2 * info["optimal_time"], 8 * info["optimal_time"])
    )
    assert sum(rewards) == pytest.approx(20.0 + 1.5, abs=0.05)  # 2 m away at first, 0.5 m at the end
    assert info["path_length"] == pytest.approx(1.5, abs=0.05)


def test_a_collision_and_the_time_limit_end_an_episode():
    terms = {"collision": -7.0, "timeout": -3.0, "step": -0.5, "progress": 0.0}
    env = NavigationEnv(map_config={"worlds": [0], "time_limit": 1.0, "clock_distance": 0.0}, reward=terms)
    rewards, info = drive(env, STILL)
    assert info["outcome"] == "timeout"
    assert info["time"] == pytest.approx(1.0)
    assert info["barn_metric"] == 0.0
    assert rewards == [-0.5] * 9 + [-3.5]
    rewards, info = drive(NavigationEnv(map_config={"worlds": [0]}, reward=terms), np.array([1.0, 0.3]))
    assert info["outcome"] == "collision"
    assert info["is_success"] is False
    assert rewards[-1] == -7.5


def test_no_return_of_a_lidar_without_a_limit_is_its_range():
    seen, _ = NavigationEnv("env1", "turtlebot2", map_config={"worlds": [0]}).reset(seed=0)
    assert seen["scan"].max() <= np.float32(12.0)


def test_robots_may_be_drawn(says):
    def draw(rng):
        robot = load_robot("jackal")
        robot.v_max = float(rng.uniform(0.5, 2.0))
        return robot

    env = NavigationEnv(robot=draw, map_config=MANY)
    seen = {float(env.reset(seed=seed)[0]["limits"][0]) for seed in (0, 1, 2)}
    assert len(seen) == 3
    assert min(seen) >= 0.5
    with says.raises(InputError, match="radius.*null"):
        NavigationEnv("env1", draw)


def test_a_frame_shows_the_robot_where_it_is():
    env = NavigationEnv(map_config={"worlds": [0]}, render_mode="rgb_array")
    assert env.render() is None  # no episode yet
    env.reset(seed=0)
    frames = [env.render()]
    for _ in range(10):
        env.step(AHEAD)
    frames.append(env.render())
    for picture in frames:
        assert picture.dtype == np.uint8
        assert picture.shape == frames[0].shape
        assert set(picture.shape[:2]) & {600}
    middles = [np.argwhere((picture == (40, 90, 200)).all(axis=2)).mean(axis=0) for picture in frames]
    assert middles[1][0] < middles[0][0] - 40  # up the picture, that is ahead
    assert abs(middles[1][1] - middles[0][1]) < 3
    assert NavigationEnv().render() is None


@pytest.mark.parametrize(
    "keywords",
    [
        {"map": "bran"},
        {"robot": "jakcal"},
        {"sim": "fats"},
        {"map_config": {"subsets": "all"}},
        {"map_config": {"subset": "al"}},
        {"map_config": {"worlds": "all"}},
        {"map_config": {"goal": [1.0, "x"]}},
        {"sim_config": {"latency": -1.0}},
        {"sim_config": {"latency": "long"}},
        {"sim_config": {"even_ramp": 1}},
        {"robot": "stage", "sim": "skid"},
        {"people": "seen"},
        {"reward": {"sucess": 1.0}},
        {"reward": {"success": np.nan}},
        {"render_mode": "human"},
        pytest.param({"map": load_map_set("barn"), "map_config": MANY}, id="map and map_config"),
    ],
    ids=str,
)
def test_a_mistake_is_one_line_that_says_what_would_be_right(keywords, says):
    with says.raises(InputError):
        NavigationEnv(**keywords).reset()


def test_a_mistake_while_driving_is_one_line(says):
    env = NavigationEnv(map_config=MANY)
    with says.raises(InputError):
        env.step(AHEAD)
    env.reset()
    with says.raises(InputError):
        env.step(np.array([np.nan, 0.0]))
    with says.raises(InputError):
        env.step(np.array([1.0]))
    with says.raises(InputError, match="world.*1"):
        env.reset(options={"world": 1})
    with says.raises(InputError):
        env.reset(options={"wrold": 1})
