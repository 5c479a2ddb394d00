"""Systems and planners that have become ablations: their words, and runs that were started with them."""

import json
from pathlib import Path

import pytest

from lme.errors import InputError
from runners.cli.main import main
from runners.config import former
from runners.config.catalogue import shipped
from runners.config.command_line import compose

SHORT = ("map=env1", "robot=stage", "map.worlds=[0]", "map.time_limit=0.4", "runs=1", "executor=serial")
SOME = (
    "none,no_a_reach,no_memory,no_grip"  # which set a parameter, a key of the guide, and one of the planner
)


@pytest.mark.parametrize(
    ("group", "name", "pair"),
    [
        ("system", "lme_plus_no_memory", ("lme_plus", "no_memory")),
        ("system", "lme_plus_no_c_o", ("lme_plus", "no_c_o")),
        ("planner", "min_time_no_latency", ("min_time", "no_latency")),
        ("system", "lme_no_c_t", None),  # still a system
        ("system", "lme_plus_no_such", None),
        ("system", "lme_plus", None),
        ("map", "barn_no_c_o", None),
    ],
)
def test_options_that_became_ablations_are_known(group, name, pair):
    assert former.option(group, name, shipped()) == pair


@pytest.mark.parametrize(
    ("words", "now"),
    [
        ("system=lme_plus_no_c_o seed=3", "system=lme_plus ablation=no_c_o seed=3"),
        ("planner=min_time_no_latency", "planner=min_time ablation=no_latency"),
        ("system=lme_plus planner=min_time_no_latency", "system=lme_plus planner=min_time ablation=no_latency"),
        (
            "system=lme_plus_no_memory planner=min_time_no_latency",
            "system=lme_plus ablation=[no_memory,no_latency] planner=min_time",
        ),
        ("system=lme_plus_no_memory ablation=none", "system=lme_plus ablation=no_memory"),
        ("system=lme_plus_no_memory ablation=[no_c_o,no_c_t]", "system=lme_plus ablation=[no_memory,no_c_o,no_c_t]"),
        (
            "seed=1,2 system=lme_plus,lme_plus_no_memory,lme_plus_no_c_o runs=1,2",
            "seed=1,2 system=lme_plus ablation=none,no_memory,no_c_o runs=1,2",
        ),
        (
            "system=lme_plus_no_memory seed=1,2 ablation=none,no_c_o",
            "system=lme_plus seed=1,2 ablation=no_memory,[no_memory,no_c_o]",
        ),
        ("planner=min_time,min_time_no_latency", "planner=min_time ablation=none,no_latency"),
    ],
)  # fmt: skip
def test_a_run_has_its_system_and_ablation_in_todays_words(words, now):
    assert former.in_todays_words(words.split(), shipped()) == now.split()


@pytest.mark.parametrize(
    "words",
    [
        "system=lme_no_c_t map=lme_plus_no_c_o seed=3",
        "system=lme,lme_plus ablation=none,no_c_o",
        "system=lme,lme_plus,lme_plus_no_memory",  # LME has no memory that it could do without
        "system=lme_plus,lme_plus_no_memory ablation=none,no_c_o",
        "system=lme_plus,lme_plus_no_memory planner=min_time,min_time_no_latency",
    ],
)
def test_words_that_are_todays_or_cannot_be_stay(words):
    assert former.in_todays_words(words.split(), shipped()) == words.split()


def with_words(run, *words):
    """Let a run look as if these words had started it."""
    saved = json.loads((run / "launch.json").read_text())
    (run / "launch.json").write_text(json.dumps({**saved, "overrides": [*words, *SHORT, "tracking=none"]}))


@pytest.fixture
def drive(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def drive(*words):
        place = "hydra.sweep.dir=run" if "-m" in words else "hydra.run.dir=run"
        assert main(["eval", *words, *SHORT, "tracking=none", place]) == 0
        return Path("run")

    return drive


@pytest.mark.parametrize(
    ("today", "before"),
    [
        (["-m", "system=lme_plus", f"ablation={SOME}"],
         [f"system={','.join(f'lme_plus_{name}' for name in SOME.split(',')).replace('lme_plus_none', 'lme_plus')}"]),
        (["system=lme_plus", "ablation=no_latency", "sim.latency=0.2"],
         ["system=lme_plus", "planner=min_time_no_latency", "sim.latency=0.2"]),
    ],
    ids=["sweep", "planner"],
)  # fmt: skip
def test_a_run_of_former_options_is_resumed(drive, capsys, today, before):
    run = drive(*today)
    with_words(run, *before)
    records = {path: path.read_bytes() for path in run.rglob("episodes.parquet")}
    assert main(["eval", "resume=run"]) == 0
    assert {path: path.read_bytes() for path in run.rglob("episodes.parquet")} == records
    assert len(records) == len(before[0].split(","))


def test_a_sweep_that_todays_words_cannot_make_is_resumed_job_by_job(drive, capsys):
    run = drive("-m", "system=lme_plus", "ablation=none,no_memory")
    with_words(run, "system=lme,lme_plus_no_memory")
    with_words(run / "1", "system=lme_plus_no_memory")
    capsys.readouterr()
    assert main(["eval", "resume=run"]) == 2
    assert capsys.readouterr().err == (
        "lme eval: resume=run: system=lme,lme_plus_no_memory is no longer one sweep, because lme_plus_no_memory is now "
        "system=lme_plus ablation=no_memory; resume its jobs one by one, lme eval resume=run/0 and so on (lme table "
        "run tabulates all), or start again in another directory\n"
    )
    assert main(["eval", "resume=run/1"]) == 0


def test_a_sweep_that_has_other_jobs_today(drive, capsys):
    run = drive("-m", "seed=range(2)")
    with_words(run, "seed=range(3)")
    capsys.readouterr()
    assert main(["eval", "resume=run"]) == 2
    said = capsys.readouterr().err
    assert "run: holds a sweep of 2 jobs, which today has 3: " in said
    assert "have changed since; resume its jobs one by one, lme eval resume=run/0 and so on" in said


def test_the_former_words_are_refused_with_todays():
    with pytest.raises(InputError, match=r"no such option; write planner=min_time ablation=no_latency"):
        compose("eval", ["planner=min_time_no_latency"])
