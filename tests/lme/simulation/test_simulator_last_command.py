"""What simulators say of the last command, and that without disturbances the robot moves exactly as it says."""

import numpy as np
import pytest

import lme
from lme.config.presets import load_settings
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.types import Twist
from tests.builders import CLUTTER, stage, task
from tests.tolerances import KERNEL


class Watch:
    """An observer of an episode that holds what was observed and commanded."""

    def __init__(self):
        self.observations, self.commands = [], []

    def decided(self, observation, guidance, command, state):
        self.observations.append(observation)
        self.commands.append(command)

    def ended(self, observation, state):
        pass


@pytest.mark.parametrize("even_ramp", [False, True])
@pytest.mark.parametrize("system", ["lme", "lme_plus", "dwa_tuned", "s3_fisvfh", "tangent_bug", "eband"])
def test_without_disturbances_the_twist_is_the_last_command_bit_for_bit(system, even_ramp):
    robot = lme.load_robot("jackal")
    world = lme.load_map_set("barn", {"worlds": [120]}).task(120)
    watch = Watch()
    simulator = FastSimulator(load_settings("sim/fast", even_ramp=even_ramp), robot)
    lme.run_episode(world, lme.load_system(system, robot), simulator, np.random.default_rng(0), watch)
    assert len(watch.observations) > 20
    assert all(seen.twist == seen.last_command for seen in watch.observations)
    assert any(seen.twist.v > 0.0 for seen in watch.observations)
    # It is what the navigator commanded, but for the rounding of the ramp.
    sent, followed = watch.commands[:-1], [seen.last_command for seen in watch.observations[1:]]
    np.testing.assert_allclose(followed, sent, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("system", ["lme", "lme_plus", "dwa_tuned"])
def test_without_disturbances_both_kinds_of_feedback_drive_the_same_episode(system):
    robot, world = lme.load_robot("jackal"), lme.load_map_set("barn", {"worlds": [120]}).task(120)
    one, other = (
        lme.run_episode(
            world,
            lme.load_system(system, robot, feedback=feedback),
            FastSimulator(load_settings("sim/fast"), robot),
            np.random.default_rng(0),
        )
        for feedback in ("OPEN_LOOP", "CLOSED_LOOP")
    )
    np.testing.assert_array_equal(one.trajectory, other.trajectory)


@pytest.mark.parametrize(
    "config", [load_settings("sim/fast", latency=0.3), load_settings("sim/fast", lag=0.2)]
)
def test_with_disturbances_the_last_command_is_what_was_sent(config):
    simulator = FastSimulator(config, stage())
    assert simulator.reset(task(CLUTTER), np.random.default_rng(0)).last_command == (0.0, 0.0)
    seen = simulator.step(Twist(9.0, 0.1))
    assert seen.last_command == pytest.approx((0.4, 0.1), abs=KERNEL)  # as far as the robot's limits allow
    assert seen.twist.v < 0.35
    assert simulator.step(Twist(9.0, 0.1)).last_command == pytest.approx((0.5, 0.1), abs=KERNEL)


def test_the_physics_say_it_too():
    simulator = PhysicsSimulator(load_settings("sim/physics"), stage())
    simulator.reset(task(CLUTTER), np.random.default_rng(0))
    assert simulator.step(Twist(0.3, -0.2)).last_command == pytest.approx((0.3, -0.2), abs=KERNEL)
