"""Gymnasium's vector environment against Gymnasium's own row of single ones."""

import numpy as np
import pytest

gym = pytest.importorskip("gymnasium")
from gymnasium.vector import AutoresetMode  # noqa: E402

from lme.config.presets import load_robot  # noqa: E402
from lme.errors import InputError  # noqa: E402
from lme.gym.envs import NavigationVectorEnv, vector_env  # noqa: E402

SHORT = {"worlds": [0, 150, 299], "time_limit": 2.5}

SOON = {"worlds": [0, 1], "time_limit": 3.0}


def any_limits(rng):
    robot = load_robot("jackal")
    robot.v_max, robot.alpha_v = rng.uniform(0.5, 2.0, 2).tolist()
    return robot


def plain(infos):
    """Infos whose last observations are a list, which NumPy's comparison can look into."""
    return {key: list(value) if key == "final_obs" else value for key, value in infos.items()}


@pytest.mark.parametrize(
    ("env_id", "keywords"),
    [
        ("Barn", {"map_config": SHORT}),
        ("Barn", {"map_config": SHORT, "robot": any_limits, "reward": {"progress": 3.0, "step": -0.1}}),
        ("Barn", {"map_config": SHORT, "sim": "gazebo"}),
        ("Barn", {"map_config": SHORT, "sim_config": {"latency": 0.15, "slip": 0.1, "goal_noise": 0.1}}),
        ("Env1", {"map_config": {"time_limit": 3.0, "worlds": [0, 1]}, "sim_config": {"even_ramp": True}}),
        ("Dynabarn", {"map_config": SOON, "people": "truth", "sim_config": {"scan_noise": 0.02}}),
        ("Social", {"map_config": {"kind": "crossing", **SOON}, "people": "truth", "sim": "skid"}),
    ],
)
def test_a_vector_environment_is_a_row_of_single_ones_bit_by_bit(env_id, keywords):
    name, n = f"lme:lme/{env_id}-v0", 4
    same_step = {"autoreset_mode": AutoresetMode.SAME_STEP}
    row = gym.make_vec(name, n, vectorization_mode="sync", vector_kwargs=same_step, **keywords)
    many = gym.make_vec(name, n, **keywords)
    assert isinstance(many, NavigationVectorEnv)
    assert many.observation_space == row.observation_space
    assert many.action_space == row.action_space
    assert many.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    np.testing.assert_equal(many.reset(seed=5), row.reset(seed=5))
    many.action_space.seed(0)
    ended = 0
    for _ in range(80):
        actions = np.abs(many.action_space.sample())
        one, other = many.step(actions), row.step(actions)
        for mine, its in zip(one[:4], other[:4], strict=True):
            np.testing.assert_equal(mine, its)
        assert one[4].keys() == other[4].keys()
        np.testing.assert_equal(plain(one[4]), plain(other[4]))
        assert one[0] in many.observation_space
        ended += int((one[2] | one[3]).sum())
    assert ended > n
    np.testing.assert_equal(many.reset(seed=[1, 2, 3, 4])[0], row.reset(seed=[1, 2, 3, 4])[0])
    world = {"world": keywords["map_config"]["worlds"][1]}
    np.testing.assert_equal(many.reset(seed=1, options=world), row.reset(seed=1, options=world))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_the_other_autoreset_modes_are_those_of_gymnasium(mode):
    n, keywords = 4, {"map_config": SHORT}
    row = gym.make_vec(
        "lme:lme/Barn-v0", n, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **keywords
    )
    many = gym.make_vec("lme:lme/Barn-v0", n, autoreset_mode=mode.value, **keywords)
    assert many.metadata["autoreset_mode"] is mode
    np.testing.assert_equal(many.reset(seed=5), row.reset(seed=5))
    many.action_space.seed(0)
    ended = 0
    for _ in range(60):
        actions = np.abs(many.action_space.sample())
        one, other = many.step(actions), row.step(actions)
        np.testing.assert_equal(one, other)
        over = one[2] | one[3]
        ended += int(over.sum())
        if mode is AutoresetMode.DISABLED and over.any():
            np.testing.assert_equal(
                many.reset(options={"reset_mask": over}), row.reset(options={"reset_mask": over.copy()})
            )
    assert ended > n


@pytest.mark.parametrize("keywords", [{"sim": "physics"}, {"people": "tracked"}], ids=str)
def test_what_cannot_be_driven_together_is_driven_in_a_row_with_a_warning(keywords, says):
    with says.warns(match="2 robots are therefore simulated one after another"):
        envs = vector_env(2, **keywords)
    assert isinstance(envs, gym.vector.SyncVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert envs.reset(seed=0)[0]["scan"].shape == (2, 720)


def test_the_scan_is_not_copied():
    many = NavigationVectorEnv(2, map_config=SHORT)
    many.reset(seed=0)
    assert many.step(np.zeros((2, 2)))[0]["scan"] is many.fleet._views.ranges


def test_observations_are_not_overwritten_by_later_steps():
    many = NavigationVectorEnv(3, map_config=SHORT)
    kept = [many.reset(seed=0)[0]]
    copies = [{name: part.copy() for name, part in kept[0].items()}]
    for _ in range(30):
        kept.append(many.step(np.full((3, 2), 0.5))[0])
        copies.append({name: part.copy() for name, part in kept[-1].items()})
    np.testing.assert_equal(kept, copies)


@pytest.mark.parametrize(
    "keywords",
    [
        {"sim": "physics"},
        {"robot": "turtlebot2"},
        {"people": "tracked"},
        {"render_mode": "rgb_array"},
    ],
    ids=str,
)
def test_the_vector_env_refuses_what_it_does_not_cover_and_says_what_does(keywords, says):
    with says.raises(InputError) as caught:
        NavigationVectorEnv(2, **keywords).reset(seed=0)
    assert 'vectorization_mode="sync"' in str(caught.value)


def test_mistakes_while_driving(says):
    many = NavigationVectorEnv(2, map_config=SHORT)
    with says.raises(InputError):
        many.step(np.zeros((2, 2)))
    many.reset()
    with says.raises(InputError):
        many.step(np.array([[0.0, 0.0], [np.nan, 0.0]]))
    manual = NavigationVectorEnv(2, map_config=SHORT, autoreset_mode="Disabled")
    manual.reset()
    with says.raises(InputError):
        manual.reset(options={"reset_mask": np.zeros(2, bool)})
    with pytest.raises(InputError, match="options has 'reset_mask'"):
        many.reset(options={"reset_mask": np.ones(2, bool)})


def test_a_limit_of_steps_is_refused_with_what_to_give(says):
    with says.raises(InputError, match="time_limit"):
        gym.make_vec("lme:lme/Barn-v0", num_envs=2, max_episode_steps=5)
