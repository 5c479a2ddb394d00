"""The group `filter`: what it builds, that it follows delays, and that older runs keep their identity."""

import pytest

from lme.errors import InputError
from lme.planners.min_time import MinTime
from lme.planners.safety import SafetyFilter
from lme.planners.simple import Simple
from runners.config import build
from runners.records.launch_record import identity, recorded_config
from tests.composing import jobs_of

SMALL = ["map.worlds=[0]", "runs=1", "executor=serial", "tracking=none"]


def job_of(*words):
    with jobs_of("eval", *SMALL) as job:
        return job(*words)


def test_the_default_is_no_filter_and_keeps_the_identity_of_older_runs():
    job = job_of()
    assert isinstance(build.navigator(job.config).planner, Simple)
    assert "filter" not in identity(job.config)
    assert recorded_config(identity(job.config)).filter == {}


def test_a_filter_is_built_around_the_planner_recorded_and_changed_by_key():
    job = job_of("system=lme_plus", "filter=stopping", "filter.margin=0.03", "sim.latency=0.2")
    made = build.navigator(job.config).planner
    assert isinstance(made, SafetyFilter)
    assert isinstance(made.planner, MinTime)
    assert recorded_config(identity(job.config)).filter == job.config.filter
    assert job.config.filter["latency"] == 0.2
    assert job.changes["filter.margin"] == 0.03
    assert "filter.latency" not in job.changes
    assert job.choices["filter"] == "stopping"


def test_a_wrong_value_is_named():
    with pytest.raises(InputError, match=r"filter\.margin is -1"):
        build.navigator(job_of("filter=stopping", "filter.margin=-1").config)
