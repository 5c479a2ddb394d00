"""The observation as one vector."""

import itertools

import numpy as np
import pytest

gym = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from lme.errors import InputError  # noqa: E402
from lme.gym.envs import NavigationEnv  # noqa: E402
from lme.gym.spaces import FlatObservation, flattened  # noqa: E402


def test_a_flat_observation_is_scan_target_and_last_action_in_one_vector():
    env = NavigationEnv(map_config={"worlds": [0]})
    flat = FlatObservation(env)
    assert flat.observation_space.shape == (724,)
    vector, _ = flat.reset(seed=0)
    plain, _ = NavigationEnv(map_config={"worlds": [0]}).reset(seed=0)
    np.testing.assert_allclose(vector[:720], np.minimum(plain["scan"], 5.0) / 2.5 - 1.0, atol=1e-6)
    np.testing.assert_allclose(vector[720:722], plain["target"] / 10.0, atol=1e-6)  # 10 m ahead, drawn in
    assert vector[722:].tolist() == [0.0, 0.0]
    vector, *_ = flat.step(np.array([0.5, -2.0]))
    assert vector[722:].tolist() == [0.5, -1.0]
    assert vector in flat.observation_space


def test_fewer_beams_are_the_nearest_returns():
    plain, _ = NavigationEnv(map_config={"worlds": [7]}).reset(seed=0)
    vector, _ = FlatObservation(NavigationEnv(map_config={"worlds": [7]}), clip=3.0, beams=72).reset(seed=0)
    expected = [min(plain["scan"][10 * k : 10 * k + 10].min(), 3.0) / 1.5 - 1.0 for k in range(72)]
    np.testing.assert_allclose(vector[:72], expected, atol=1e-6)
    assert np.hypot(*vector[72:74]) == pytest.approx(1.0)  # farther than 6 m


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_gymnasiums_checker_has_no_complaint():
    env = gym.make("lme:lme/Env1-v0")
    check_env(FlatObservation(env.unwrapped, beams=60), skip_render_check=True)


def test_a_wrong_number_of_beams_or_clip_is_named(says):
    env = NavigationEnv()
    for beams in (0, 721):
        with says.raises(InputError, match=f"beams is {beams}"):
            FlatObservation(env, beams=beams)
    with says.raises(InputError, match="clip.*0"):
        FlatObservation(env, clip=0.0)


@pytest.mark.parametrize("num_beams", [720, 811, 1081])
def test_sectors_may_differ_by_a_beam(num_beams):
    scan = np.random.default_rng(0).uniform(0, 9, (3, num_beams)).astype(np.float32)
    observation = {"scan": scan, "target": np.zeros((3, 2), np.float32)}
    flat = flattened(observation, np.zeros((3, 2)), 72)
    firsts = [k * num_beams // 72 for k in range(73)]
    assert {b - a for a, b in itertools.pairwise(firsts)} <= {num_beams // 72, num_beams // 72 + 1}
    for k, (first, stop) in enumerate(itertools.pairwise(firsts)):
        nearest = np.minimum(scan[:, first:stop].min(axis=1), 5.0) / 5.0 * 2.0 - 1.0
        np.testing.assert_array_equal(flat[:, k], nearest.astype(np.float32))
