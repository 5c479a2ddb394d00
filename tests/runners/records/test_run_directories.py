"""Which folders are jobs of a sweep, and whether a run may be resumed."""

from runners.records.launch_record import Launch
from runners.records.run_directories import jobs_of_sweep


def launch(**fields):
    return Launch(
        **{
            "command": "eval",
            "fingerprint": "0",
            "multirun": False,
            "overrides": [],
            "configs": [{}],
            **fields,
        }
    )


def test_jobs_beyond_those_named_need_records(tmp_path):
    """A sweeper plugin may run more jobs than the command line names; a larger sweep may leave empty folders."""
    for number in (2, 0, 1, 3):
        place = tmp_path / f"job{number}"
        place.mkdir()
        launch(job=number).write(place)
    (tmp_path / "job2" / "episodes.parquet").touch()
    assert [place.name for place in jobs_of_sweep(tmp_path, 1)] == ["job0", "job2"]
