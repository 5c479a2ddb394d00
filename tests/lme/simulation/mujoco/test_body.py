"""The body of the Go2: the figures that it is published with, and legs that mirror each other."""

import numpy as np
import pytest

from lme.simulation.crowd import Crowd
from lme.simulation.mujoco import body
from lme.simulation.mujoco.arena import Arena
from lme.worlds.world import World

pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")


@pytest.fixture(scope="module")
def model():
    return Arena(World(), Crowd(()), body.add_robot).model


def test_it_has_the_mass_of_a_go2(model):
    assert (
        15.0 < model.body_mass.sum() < 19.0
    )  # 15 kg with its battery, by Unitree; the fit makes the legs heavier


def test_every_inertia_is_possible(model):
    least, middle, most = np.sort(model.body_inertia[1:], axis=1).T
    assert (least > 0.0).all()
    assert (most <= least + middle).all()


def test_the_feet_stand_below_the_hips_in_the_stance(model):
    mujoco = pytest.importorskip("mujoco")
    data = mujoco.MjData(model)
    data.qpos[7:] = [0.0, 0.8, -1.5] * 4
    mujoco.mj_forward(model, data)
    feet = np.array([data.geom(f"foot_{leg}").xpos for leg in body.LEGS])
    np.testing.assert_allclose(np.abs(feet[:, 1]), body.HIP_Y + body.HIP_WIDTH, atol=1e-9)
    np.testing.assert_allclose(feet[0] * [1, -1, 1], feet[1], atol=1e-9)
    np.testing.assert_allclose(feet[2] * [1, -1, 1], feet[3], atol=1e-9)
    np.testing.assert_allclose(feet[:, 2], -0.311, atol=0.005)
    assert (feet[:2, 0] > 0.1).all()
    assert (feet[2:, 0] < -0.1).all()


@pytest.mark.parametrize(("front", "left"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_a_mirrored_inertia_is_that_of_mirrored_masses(front, left):
    points, masses = np.random.default_rng(0).normal(size=(20, 3)), np.linspace(1.0, 2.0, 20)

    def inertial(points):
        com = masses @ points / masses.sum()
        x, y, z = (points - com).T
        moments = tuple(float(masses @ sum_) for sum_ in (y * y + z * z, x * x + z * z, x * x + y * y))
        products = tuple(float(-masses @ product) for product in (x * y, x * z, y * z))
        return body.Inertial(float(masses.sum()), tuple(com.tolist()), moments, products)

    mirrored, expected = inertial(points).mirrored(front, left), inertial(points * [front, left, 1])
    for one, other in zip(mirrored, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_joints_turn_in_radians(model):
    assert model.joint("FL_calf").range == pytest.approx(body.KNEE_RANGE)
    assert [model.joint(i).name for i in range(1, model.njnt)] == list(body.JOINTS)
