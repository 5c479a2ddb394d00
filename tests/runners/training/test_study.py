"""A study: killed at any byte it ends as if nothing had happened, and damage is reported in one line."""

import json
import math
import os
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.config.escaping import masked
from runners.config.space import Range, own_values
from runners.training import storage
from runners.training.journal import Journal
from runners.training.race_log import SCORE_LOG, ScoreLog
from runners.training.samplers import (
    Cmaes,
    Gp,
    Random,
    Tpe,
    per_trial,
    trial_seed,
)
from runners.training.search import JOURNAL, open_study, run_trials
from runners.workers.trials import Attempt, Score
from tests.composing import jobs_of

SPACE = {
    "guide.parameters.a": Range(0.01, 10.0, True),
    "planner.b": Range(0.0, 1.0),
    "planner.c": Range(1.0, 9.0),
}
PLACES = [("open", 7), ("narrow", 3)]
TRIALS = 22  # three generations and the beginning of another, for the evolution strategy
SEARCHES = {
    "tpe": lambda: Tpe(load_settings("search/tpe", startup=5)),
    "cmaes": lambda: Cmaes(load_settings("search/cmaes", batch=6)),
    "random": lambda: Random(load_settings("search/random")),
    "gp": lambda: Gp(load_settings("search/gp", startup=5)),
}


def identity(seed=0, **changes):
    return {"seed": seed, "robot": {"name": "stage", "v_max": 0.5}, "trials": 9, **changes}


def opened(folder, search="tpe", url=None, name=None, first=None, **changes):
    return open_study(url, name, Path(folder), identity(**changes), SPACE, SEARCHES[search](), first or {})


def score(attempt):
    """A smooth reward with its peak inside the space."""
    a, b, c = (value for _, value in attempt.values)
    reward = 1 - (math.log(a) - 0.3) ** 2 / 20 - (b - 0.4) ** 2 - abs(c - 5) / 10 - attempt.world / 100
    return Score(attempt.trial, attempt.world, "success", 1, reward, attempt.family)


def run(study, search="tpe", total=TRIALS, order=iter):
    batch = SEARCHES[search]().batch
    run_trials(
        study, total, batch, PLACES, lambda attempts: map(score, order(list(attempts))), lambda *_: None
    )
    return [(trial.number, trial.reward, trial.values, trial.scores) for trial in study.finished_trials]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Of each search: what the uninterrupted study came to, and its journal."""
    found = {}

    def of(search):
        if search not in found:
            folder = tmp_path_factory.mktemp(search)
            found[search] = run(opened(folder, search), search), (folder / JOURNAL).read_bytes()
        return found[search]

    return of


def test_a_study_has_its_trials_and_no_more(whole, tmp_path):
    trials, journal = whole("tpe")
    assert [number for number, *_ in trials] == list(range(TRIALS))
    (tmp_path / JOURNAL).write_bytes(journal)
    assert run(opened(tmp_path)) == trials
    assert (tmp_path / JOURNAL).read_bytes() == journal


def test_the_reward_of_a_trial_is_the_mean_of_its_configurations(whole):
    for _, reward, values, scores in whole("tpe")[0]:
        assert [found.place for found in scores] == PLACES
        assert reward == (scores[0].reward + scores[1].reward) / 2
        assert set(values) == set(SPACE)
        assert all(SPACE[key].low <= value <= SPACE[key].high for key, value in values.items())


@settings(max_examples=settings.default.max_examples // 3)  # each takes long
@given(share=st.floats(0, 1))
def test_killed_at_any_byte_it_ends_as_the_uninterrupted_one(whole, share):
    trials, journal = whole("tpe")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, JOURNAL).write_bytes(journal[: round(share * len(journal))])
        assert run(opened(folder)) == trials


@pytest.mark.parametrize("search", ["cmaes", "random"])
@pytest.mark.parametrize("share", [0.1, 0.35, 0.62, 0.9])
def test_a_search_killed_at_any_byte_ends_as_an_uninterrupted_one(whole, search, share, tmp_path):
    trials, journal = whole(search)
    (tmp_path / JOURNAL).write_bytes(journal[: round(share * len(journal))])
    assert run(opened(tmp_path, search), search) == trials


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.35, 0.62, 0.9])
def test_a_gaussian_process_killed_at_any_byte_ends_as_the_uninterrupted_one(whole, share, tmp_path):
    pytest.importorskip("torch")
    test_a_search_killed_at_any_byte_ends_as_an_uninterrupted_one(whole, "gp", share, tmp_path)


def test_a_trial_that_was_run_is_not_run_again(whole, tmp_path):
    """Killed when the first trial of a batch was over and the others were not."""
    study = opened(tmp_path)
    proposals = study.claim(4, 4)
    study.store_scores(1, [Score(1, world, "success", 1, 0.5, family) for family, world in PLACES])
    again, seen = opened(tmp_path), []
    assert again.claim(4, 4) == proposals

    def note(attempts):
        seen.extend(attempt.trial for attempt in attempts)
        return map(score, attempts)

    run_trials(again, 4, 4, PLACES, note, lambda *_: None)
    assert set(seen) == {0, 2, 3}
    assert again.finished_trials[1].reward == 0.5


def test_the_order_in_which_episodes_end_changes_nothing(whole, tmp_path):
    assert run(opened(tmp_path), order=reversed) == whole("tpe")[0]


def test_another_seed_makes_another_search(whole, tmp_path):
    assert run(opened(tmp_path, seed=1))[0][2] != whole("tpe")[0][0][2]
    assert len({trial_seed(seed, number) for seed in range(20) for number in range(20)}) == 400


@pytest.mark.parametrize("search", ["tpe", "cmaes"])
def test_the_search_finds_more_than_chance(whole, search):
    best = {name: max(reward for _, reward, *_ in whole(name)[0][-8:]) for name in (search, "random")}
    assert best[search] > best["random"] - 0.05


def test_the_journal_is_optunas_own(whole, tmp_path):
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    trials, journal = whole("tpe")
    (tmp_path / JOURNAL).write_bytes(journal)
    storage = JournalStorage(JournalFileBackend(str(tmp_path / JOURNAL)))
    (summary,) = optuna.get_all_study_summaries(storage)
    study = optuna.load_study(study_name=summary.study_name, storage=storage)
    assert [trial.value for trial in study.trials] == [reward for _, reward, *_ in trials]


def test_importances_need_trials_that_differ(tmp_path, whole):
    assert opened(tmp_path).importances() == {}
    (tmp_path / JOURNAL).write_bytes(whole("tpe")[1])
    shares = opened(tmp_path).importances()
    assert set(shares) == set(SPACE)
    assert sum(shares.values()) == pytest.approx(1)


# What is refused


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 1},
        {"robot": {"name": "go2", "v_max": 0.5}},
        {"space": {"planner": {"b": {"high": 2}}}},
    ],
    ids=str,
)
def test_a_study_of_something_else_is_refused(tmp_path, changes, says):
    url = f"sqlite:///{tmp_path}/shared.db"
    opened(tmp_path, url=url, name="mine")
    with says.raises(InputError):
        opened(tmp_path, url=url, name="mine", **changes)
    opened(tmp_path, url=url, name="mine", trials=500, runs=9)


def test_a_damaged_journal_names_its_line(whole, tmp_path, says):
    lines = whole("random")[1].splitlines(keepends=True)
    path = tmp_path / JOURNAL
    for damage in (
        b"{torn\n",
        b"17\n",
        b'{"op_code": 4}\n',
        b'{"op_code": 4, "worker_id": "", "system_attr": 5}\n',
        b'{"op_code": 6, "worker_id": "", "trial_id": 0, "state": 1, "values": ["x"]}\n',
    ):
        path.write_bytes(b"".join([*lines[:5], damage, *lines[5:]]))
        with says.raises(InputError):
            opened(tmp_path, "random")
    path.write_bytes(b"".join(lines[:5] + lines[9:]))
    with says.raises(InputError):
        opened(tmp_path, "random")


def test_every_entry_of_the_journal_is_a_line_of_json(whole):
    assert all(json.loads(line)["op_code"] >= 0 for line in whole("cmaes")[1].splitlines())


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("nonsense", "storage is nonsense: cannot be used"),
        ("sqlite:////proc/nowhere/x.db", "storage is sqlite:////proc/nowhere/x.db: cannot be used"),
        (
            "postgresql+nodriver://me:secret@127.0.0.1:1/x",
            "storage is postgresql+nodriver://me:***@127.0.0.1:1/x",
        ),
        ("redis://127.0.0.1:1/0", "storage is redis://127.0.0.1:1/0: "),
        ("postgresql://me:secret@127.0.0.1:1/x", "me:***@127.0.0.1:1/x: cannot be used (connection failed"),
    ],
)
def test_a_storage_that_cannot_be_reached(tmp_path, url, said):
    with pytest.raises(InputError) as caught:
        opened(tmp_path, url=url)
    assert said in str(caught.value)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_driver_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(InputError, match="needs psycopg") as caught:
        storage.open_storage("postgresql://me:secret@127.0.0.1:1/x")
    assert "pip install 'psycopg" in str(caught.value)
    assert "secret" not in str(caught.value)


def test_a_password_is_masked():
    assert masked("mysql://me:a@b@host/db") == "mysql://me:***@host/db"
    assert masked("sqlite:///x.db") == "sqlite:///x.db"


# A storage that several runs share


def test_a_database_holds_the_same_study(whole, tmp_path):
    study = opened(tmp_path, url=f"sqlite:///{tmp_path}/shared.db")
    assert run(study, total=8) == [*whole("tpe")[0][:8]]


def test_a_trial_of_a_killed_process_goes_to_another(tmp_path, monkeypatch):
    """With its values; and the killed process, if it was only away, is not reported a second time."""
    monkeypatch.setattr(storage, "HEARTBEAT_S", 1)
    monkeypatch.setattr(storage, "GRACE_S", 1)
    url, here, there = f"sqlite:///{tmp_path}/shared.db", tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    away = opened(here, "random", url)
    left = away.claim(10, 3)
    second = opened(there, "random", url)
    assert second.num_elsewhere == 3
    told = run(second, "random", total=10)
    assert len(told) == 10
    values = [found for _, _, found, _ in told]
    assert all(proposal.values in values for proposal in left)
    away.store_scores(0, [Score(0, world, "success", 1, 9.0, family) for family, world in PLACES])
    away.tell(0)
    assert away.num_finished == 10
    assert away.best == second.best < 9.0


def test_the_trial_of_a_killed_process_is_taken_up_at_once_in_its_own_directory(tmp_path):
    url = f"sqlite:///{tmp_path}/shared.db"
    killed = opened(tmp_path, "random", url)
    left = killed.claim(9, 3)
    killed._log.add(left[1].values, [list(score(each)) for each in attempts_of(left[1])])
    again = opened(tmp_path, "random", url)
    assert again.claim(9, 3) == left
    assert [again.scored(proposal.number) for proposal in left] == [False, True, False]


def attempts_of(proposal):
    return [Attempt(proposal.number, *place, tuple(proposal.values.items())) for place in PLACES]


def test_trials_beyond_the_total_are_withdrawn(tmp_path, monkeypatch):
    """Two processes that see the same room propose at the same time."""
    url = f"sqlite:///{tmp_path}/shared.db"
    first, second = (opened(tmp_path / name, "random", url) for name in ("a", "b"))
    monkeypatch.setattr(type(second), "num_elsewhere", 0)
    assert len(first.claim(5, 3)) == 3
    assert [proposal.number for proposal in second.claim(5, 3)] == [3, 4]
    assert first.claim(5, 3) != []
    assert second.claim(5, 3) != []


def test_a_file_that_is_not_a_journal_is_not_changed(tmp_path, says):
    path = tmp_path / JOURNAL
    path.write_bytes(b"somebody's notes")
    with says.raises(InputError):
        Journal(path)
    assert path.read_bytes() == b"somebody's notes"


@pytest.mark.parametrize(
    "make",
    [
        os.mkfifo,
        lambda path: path.symlink_to("/dev/zero"),
        os.mkdir,
        lambda path: path.symlink_to(path),
    ],
)
def test_a_journal_that_is_no_file_is_one_line(tmp_path, make, says):
    make(tmp_path / JOURNAL)
    with says.raises(InputError):
        opened(tmp_path, "random")


@pytest.mark.parametrize("search", SEARCHES)
def test_the_first_trial_may_be_what_the_config_has(tmp_path, search):
    if search == "gp":
        pytest.importorskip("torch")
    first = {"guide.parameters.a": 0.25, "planner.c": 3.5}  # b is left to the search
    study = opened(tmp_path, search, first=first)
    again = opened(tmp_path, search, first=first)  # killed before it asked: still one such trial
    batch = again.claim(3, 3)
    assert first.items() <= batch[0].values.items()
    assert 0.0 <= batch[0].values["planner.b"] <= 1.0
    assert not any(first.items() <= proposal.values.items() for proposal in batch[1:])
    assert study.best is None


def test_a_repeated_trial_is_proposed_as_the_first_was():
    """Where its process was killed before the storage had its values."""
    import optuna

    def values():
        trial = study.ask()
        return [trial.suggest_float(name, 0.0, 1.0) for name in ("a", "b")]

    study = optuna.create_study(sampler=per_trial(SEARCHES["random"]().sampler, 0, {"a": 0.25}))
    first, second = values(), values()
    assert first[0] == 0.25 != second[0]
    waiting = optuna.trial.TrialState.WAITING
    study.add_trial(optuna.trial.create_trial(state=waiting, system_attrs={"failed_trial": 0}))
    assert values() == first


def test_a_trial_that_is_taken_while_it_is_proposed_is_left(tmp_path, monkeypatch):
    import optuna

    study = opened(tmp_path, "random", f"sqlite:///{tmp_path}/shared.db")
    begin = study._heartbeat.begin

    def taken(trial_id):
        begin(trial_id)
        if trial_id == 2:
            study._study.tell(1, state=optuna.trial.TrialState.FAIL)

    monkeypatch.setattr(study._heartbeat, "begin", taken)
    assert [proposal.number for proposal in study.claim(9, 3)] == [0, 2]


def test_own_values_are_those_within_the_ranges():
    with jobs_of("train", "planner=dwa") as job:
        config = job().config
    config.planner |= {"b": 0.5, "c": None}
    config.guide["parameters"] = {"a": 11.0}
    assert own_values(config, SPACE) == {"planner.b": 0.5}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"scores":[', '"scores":[true,'),
        ('"trial_id":', '"trial":'),
        ('"scores":[', '"scores":"x","y":['),
        ('"op_code":2', '"op_code":1'),  # the study is deleted
    ],
)
def test_a_journal_of_other_steps_is_damaged(whole, tmp_path, old, new):
    (tmp_path / JOURNAL).write_bytes(whole("random")[1].replace(old.encode(), new.encode()))
    with pytest.raises(InputError, match=r"study\.journal: is damaged \(\w+\): restore the file"):
        opened(tmp_path, "random")


@pytest.mark.parametrize(
    "line",
    ["nothing", "[1]", '[{"a": [1]}, []]', '[{"a": 1}, 5]', "[" * 100_000],
    ids=["no JSON", "one number", "list of values", "no scores", "deeply nested"],
)
def test_a_line_without_scores_is_named(tmp_path, line, says):
    log = ScoreLog(tmp_path / SCORE_LOG)
    log.add({"a": 1.5, "b": 2}, [("success", 1, 2.5)])
    assert ScoreLog(tmp_path / SCORE_LOG).get({"b": 2.0, "a": 1.5}) == [["success", 1, 2.5]]
    with (tmp_path / SCORE_LOG).open("a") as file:
        file.write(f"{line}\n")
    with says.raises(InputError):
        ScoreLog(tmp_path / SCORE_LOG)
