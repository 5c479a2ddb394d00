"""Numbers that take memory in proportion have an upper bound: too many are refused in one line, not a kill."""

import re

import pytest

from lme.errors import InputError
from lme.guides.lme.candidates import CandidateConfig
from lme.planners.dwa import DwaConfig
from lme.planners.mppi.config import MppiConfig
from lme.planners.ros_dwa.trajectories import TrajectoriesConfig
from lme.planners.teb.config import TebConfig
from lme.robots import Lidar
from lme.worlds.barn.map_set import BarnConfig
from lme.worlds.cold_trial import ColdTrialConfig
from lme.worlds.crowded import CrowdedConfig
from lme.worlds.indoor.map_set import IndoorConfig
from lme.worlds.rules import DrawnRules
from lme.worlds.social import SocialConfig
from lme.worlds.starts import StartsConfig

CASES = {
    "guide.candidates.number": (CandidateConfig, "number", 100_000),
    "planner.v_samples": (DwaConfig, "v_samples", 1001),
    "planner.omega_samples": (DwaConfig, "omega_samples", 1001),
    "planner.vx_samples": (TrajectoriesConfig, "vx_samples", 201),
    "planner.vtheta_samples": (TrajectoriesConfig, "vtheta_samples", 201),
    "planner.time_steps": (MppiConfig, "time_steps", 500),
    "planner.batch_size": (MppiConfig, "batch_size", 50_000),
    "planner.max_samples": (TebConfig, "max_samples", 10_000),
    "crowd.count": (CrowdedConfig, "count", 1000),
    "barn's map.count": (BarnConfig, "count", 10_000_000),
    "social's map.count": (SocialConfig, "count", 10_000_000),
    "indoor's map.count": (IndoorConfig, "count", 10_000_000),
    "the cold trial's map.count": (ColdTrialConfig, "count", 10_000_000),
    "map.starts": (StartsConfig, "starts", 10_000_000),
    "map.configurations": (DrawnRules, "configurations", 10_000_000),
}


@pytest.mark.parametrize(("name", "config", "key", "most"), [(name, *case) for name, case in CASES.items()])
def test_a_number_that_takes_memory_has_a_bound(name, config, key, most):
    config(**{key: most})
    right = rf"^{name.split()[-1]} is 1e\+09: must be .*at most {re.escape(f'{most:g}')} and finite$"
    with pytest.raises(InputError, match=right):
        config(**{key: 10**9})


@pytest.mark.parametrize("key", ["num_beams", "native_beams"])
def test_a_lidar_has_at_most_a_hundred_thousand_beams(key, says):
    values = {"num_beams": 100, "fov": 3.0, "range_min": 0.1, "range_max": 10.0}
    assert getattr(Lidar(**{**values, key: 100_000}), key) == 100_000
    with says.raises(InputError):
        Lidar(**{**values, key: 10**9})
