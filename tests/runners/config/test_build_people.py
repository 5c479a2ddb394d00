"""The key `people`: what it builds, where it is refused, and that older runs keep their identity."""

from lme.errors import InputError
from lme.perception.people.source import People, TrackedPeople
from runners.config import build
from runners.records.launch_record import identity, recorded_config
from tests.composing import jobs_of

SMALL = ["map.worlds=[0]", "runs=1", "executor=serial", "tracking=none"]


def config(*words):
    with jobs_of("eval", *SMALL) as job:
        return job(*words)


def test_the_default_keeps_the_identity_of_older_runs():
    job = config()
    assert job.config.people is People.truth
    assert "people" not in identity(job.config)
    assert "people" not in job.changes
    assert recorded_config(identity(job.config)).people is People.truth


def test_tracked_people_are_built_recorded_and_named_as_a_change():
    job = config("people=tracked")
    assert isinstance(build.navigator(job.config).people, TrackedPeople)
    assert recorded_config(identity(job.config)).people is People.tracked
    assert job.changes["people"] == "tracked"


def test_a_robot_cannot_know_the_truth(says):
    with says.raises(InputError, match="people.*truth"):
        build.refuse_truth(config().config)
