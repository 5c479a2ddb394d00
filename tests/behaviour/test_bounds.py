"""Numbers that take memory in proportion have an upper bound: too many are refused in one line, not a kill."""

import re

import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.robots import Lidar

CASES = {
    "guide.candidates.number": ("guide/lme", 100_000),
    "planner.v_samples": ("planner/dwa", 1001),
    "planner.omega_samples": ("planner/dwa", 1001),
    "planner.vx_samples": ("planner/ros_dwa", 201),
    "planner.vtheta_samples": ("planner/ros_dwa", 201),
    "planner.time_steps": ("planner/mppi", 500),
    "planner.batch_size": ("planner/mppi", 50_000),
    "planner.max_samples": ("planner/teb", 10_000),
    "crowd.count": ("crowd/orca", 1000),
    "barn's map.count": ("map/barn", 10_000_000),
    "social's map.count": ("map/social", 10_000_000),
    "indoor's map.count": ("map/indoor", 10_000_000),
    "the cold trial's map.count": ("map/_cold_trial", 10_000_000),
    "map.starts": ("map/traps", 10_000_000),
    "map.configurations": ("map/_room", 10_000_000),
}


@pytest.mark.parametrize(("name", "option", "most"), [(name, *case) for name, case in CASES.items()])
def test_a_number_that_takes_memory_has_a_bound(name, option, most):
    key = name.split()[-1]
    _, *parts, last = key.split(".")

    def load(number):
        changes = {last: number}
        for part in parts:
            changes = {part: changes}
        load_settings(option, **changes)

    load(most)
    right = rf"^{key} is 1e\+09: must be .*at most {re.escape(f'{most:g}')} and finite$"
    with pytest.raises(InputError, match=right):
        load(10**9)


@pytest.mark.parametrize("key", ["num_beams", "native_beams"])
def test_a_lidar_has_at_most_a_hundred_thousand_beams(key, says):
    values = {"num_beams": 100, "fov": 3.0, "range_min": 0.1, "range_max": 10.0}
    assert getattr(Lidar(**{**values, key: 100_000}), key) == 100_000
    with says.raises(InputError):
        Lidar(**{**values, key: 10**9})
