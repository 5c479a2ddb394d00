"""Tracking logs what it is given, continues after a resumption, and never stops a run."""

import errno
import json
import os
import socket
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.records.launch_record import Launch
from runners.tracking.description import environment_tags
from runners.tracking.mlflow import (
    MlflowTracking,
    add_files,
    close_sweep,
)
from runners.tracking.store import DEFAULTS, RUN_ID_FILE, experiment_id, log_metrics
from runners.tracking.tracking import FAILED, FINISHED, KILLED, NoTracking, NoTrackingConfig, closed_by
from tests.places import ROOT

CONFIG = {"seed": 3, "robot": {"name": "jackal", "lidar": {"num_beams": 720}}, "text": "x" * 6000}


@pytest.fixture(autouse=True)
def no_settings_of_the_user(monkeypatch):
    for name in DEFAULTS:
        monkeypatch.setenv(name, DEFAULTS[name])


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """An MLflow store in a folder that is not there before: making one takes seconds, so it is shared."""
    return f"sqlite:///{tmp_path_factory.mktemp('store')}/outputs/mlflow.db"


def book(uri, run_dir, config=CONFIG, metrics=None, artifacts=(), sweep_dir=None):
    tracking = MlflowTracking(load_settings("tracking/mlflow", uri=uri, experiment="lme"))
    began = time.monotonic()
    tracking.start(config, run_dir, {"system": "LME"}, sweep_dir)
    returned_s = time.monotonic() - began
    tracking.finish(metrics or {"success": 0.9}, artifacts)
    return returned_s


def test_a_series_is_logged_step_by_step_and_continued(store, tmp_path):
    for values in ([0.1, 0.2], [0.1, 0.2, float("nan"), 0.4]):
        tracking = MlflowTracking(load_settings("tracking/mlflow", uri=store))
        tracking.start(CONFIG, tmp_path / "series", {})
        tracking.finish({"success": 1.0}, [], {"reward": values})
    from mlflow import MlflowClient

    run = logged(store, tmp_path / "series").info.run_id
    history = MlflowClient(tracking_uri=store).get_metric_history(run, "reward")
    assert sorted((metric.step, metric.value) for metric in history) == [(0, 0.1), (1, 0.2), (3, 0.4)]


def logged(uri, run_dir):
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=uri)
    return client.get_run(json.loads((run_dir / RUN_ID_FILE).read_text())["run"])


def test_a_run_is_logged_with_everything(store, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_dir, table = tmp_path / "day" / "run", tmp_path / "table.md"
    table.write_text("| a |")
    assert book(store, run_dir, metrics={"success": 0.9, "time_s": float("nan")}, artifacts=[table]) < 1.0
    run = logged(store, run_dir)
    assert run.data.params == {
        "seed": "3",
        "robot.name": "jackal",
        "robot.lidar.num_beams": "720",
        "text": "x" * 6000,
    }
    assert run.data.metrics == pytest.approx({"success": 0.9, "time_s": float("nan")}, nan_ok=True)
    assert (run.info.status, run.info.run_name) == ("FINISHED", "LME")
    assert {"system": "LME", **environment_tags()}.items() <= run.data.tags.items()
    outputs = Path(store.removeprefix("sqlite:///")).parent
    assert [path.read_text() for path in (outputs / "mlartifacts").rglob("table.md")] == ["| a |"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["day", "table.md"]  # no ./mlruns
    assert sorted(path.name for path in outputs.iterdir()) == ["mlartifacts", "mlflow.db"]
    assert capfd.readouterr() == ("", "")


def test_a_folder_is_logged_as_a_folder_and_more_can_be_added_later(store, tmp_path):
    pages = tmp_path / "explain"
    pages.mkdir()
    (pages / "200-0.html").write_text("one")
    book(store, tmp_path, artifacts=[pages])
    before = logged(store, tmp_path)
    (pages / "201-0.html").write_text("two")
    add_files(tmp_path, [pages / "201-0.html"], "explain")
    from mlflow import MlflowClient

    found = MlflowClient(tracking_uri=store).list_artifacts(before.info.run_id, "explain")
    assert [file.path for file in found] == ["explain/200-0.html", "explain/201-0.html"]
    assert logged(store, tmp_path).info.end_time == before.info.end_time


def test_folders_of_the_same_name_stay_apart(store, tmp_path):
    pages = [tmp_path / "run" / place / "explain" for place in ("env1", "fresh")]
    for folder in pages:
        folder.mkdir(parents=True)
        (folder / "3-0.html").write_text(folder.parent.name)
    book(store, tmp_path / "run", artifacts=pages)
    from mlflow import MlflowClient

    client, run = MlflowClient(tracking_uri=store), logged(store, tmp_path / "run").info.run_id
    for folder in pages:
        found = client.download_artifacts(run, f"{folder.parent.name}/explain/3-0.html", str(tmp_path))
        assert Path(found).read_text() == folder.parent.name


def test_nothing_is_added_to_what_was_never_logged_or_lies_elsewhere(store, tmp_path):
    page = tmp_path / "page.html"
    page.write_text("one")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        add_files(tmp_path, [page], "explain")
    elsewhere = f"sqlite:///{tmp_path}/none.db"
    (tmp_path / RUN_ID_FILE).write_text(json.dumps({"uri": elsewhere, "experiment": "1", "run": "0" * 32}))
    with pytest.warns(
        UserWarning, match=r"not logged to MLflow at sqlite:///\S+/none\.db.*there is no database at"
    ):
        add_files(tmp_path, [page], "explain")
    assert not (tmp_path / "none.db").exists()
    (tmp_path / RUN_ID_FILE).write_text(json.dumps({"uri": store, "experiment": "1", "run": "0" * 32}))
    with pytest.warns(UserWarning, match="not logged to MLflow"):
        add_files(tmp_path, [page], "explain")  # no such run


def put_a_file(folder):
    (folder / "outputs").write_text("a file in the place of the folder")
    return folder / "outputs"


def shut_the_folder(folder):
    (folder / "outputs").mkdir(mode=0o500)
    return folder / "outputs"


def shut_the_store(folder):
    (folder / "outputs").mkdir()
    (folder / "outputs" / "mlflow.db").touch(mode=0o400)
    return folder / "outputs" / "mlflow.db"


@pytest.mark.parametrize("shut", [put_a_file, shut_the_folder, shut_the_store])
def test_a_store_that_cannot_be_written_is_one_line_before_the_first_episode(
    tmp_path, monkeypatch, shut, says
):
    place, store, access = shut(tmp_path), tmp_path / "outputs" / "mlflow.db", os.access
    # Nothing is read-only to root.
    monkeypatch.setattr(
        os, "access", lambda path, mode: not (path == place and mode & os.W_OK) and access(path, mode)
    )
    before = sorted(tmp_path.rglob("*"))
    tracking = MlflowTracking(load_settings("tracking/mlflow", uri=f"sqlite:///{store}"))
    with pytest.warns(UserWarning, match="cannot be written") as caught:
        tracking.start(CONFIG, tmp_path / "sweep" / "0", {}, tmp_path / "sweep")
    (said,) = [str(warning.message) for warning in caught]
    says(said)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tracking.finish({"success": 1.0}, [])
        for run in ("sweep/1", "sweep"):  # the next job, and the sweep
            later = MlflowTracking(load_settings("tracking/mlflow", uri=f"sqlite:///{store}"))
            later.start(CONFIG, tmp_path / run, {}, tmp_path / "sweep" if run != "sweep" else None)
            later.finish({"success": 1.0}, [])
    assert sorted(tmp_path.rglob("*")) == before


def test_a_store_that_cannot_be_made_after_all_is_not_tried_a_hundred_seconds_by_mlflow(
    tmp_path, monkeypatch
):
    def fail(path, *_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Path, "touch", fail)
    with pytest.warns(
        UserWarning, match="not logged to MLflow at .*; the results are on disk .*No space left"
    ):
        book(f"sqlite:///{tmp_path}/outputs/mlflow.db", tmp_path / "run")
    assert list((tmp_path / "outputs").iterdir()) == []


def test_nothing_is_added_to_a_store_that_cannot_be_written(tmp_path, monkeypatch):
    page, store = tmp_path / "page.html", tmp_path / "mlflow.db"
    page.write_text("one")
    store.touch()
    known = {"uri": f"sqlite:///{store}", "experiment": "1", "run": "0" * 32}
    (tmp_path / RUN_ID_FILE).write_text(json.dumps(known))
    monkeypatch.setattr("runners.tracking.store.obstacle", lambda path: path.parent)
    with pytest.warns(UserWarning, match=rf"not logged to MLflow .* \({tmp_path} cannot be written\)"):
        add_files(tmp_path, [page], "explain")


def test_a_resumed_run_is_the_same_run(store, tmp_path):
    book(store, tmp_path, metrics={"success": 0.1})
    first = logged(store, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        book(store, tmp_path, config={**CONFIG, "resume": True, "seed": 4}, metrics={"success": 0.8})
    second = logged(store, tmp_path)
    assert first.info.run_id == second.info.run_id
    assert second.data.metrics == {"success": 0.8}
    assert second.data.params["seed"] == "3"


def test_a_run_that_the_store_does_not_know_is_logged_again(store, tmp_path):
    (tmp_path / RUN_ID_FILE).write_text(json.dumps({"experiment": "1", "run": "0" * 32}))
    book(store, tmp_path)
    assert logged(store, tmp_path).info.run_id != "0" * 32


def test_runs_of_a_sweep_lie_below_one(store, tmp_path):
    for number in ("0", "1"):
        book(store, tmp_path / number, sweep_dir=tmp_path)
    parent = logged(store, tmp_path)
    children = [logged(store, tmp_path / number) for number in ("0", "1")]
    assert {child.data.tags["mlflow.parentRunId"] for child in children} == {parent.info.run_id}
    assert parent.info.status == "FINISHED"


def started(uri, run_dir, sweep_dir=None):
    """A tracked run that is open in the store."""
    tracking = MlflowTracking(load_settings("tracking/mlflow", uri=uri))
    tracking.start({"seed": 3}, run_dir, {}, sweep_dir)
    tracking._opening.join()
    return tracking


@pytest.mark.parametrize(
    ("error", "state"), [(KeyboardInterrupt, KILLED), (ValueError, FAILED), (SystemExit, FAILED)]
)
def test_a_run_that_does_not_finish_is_closed_with_its_state_and_finishes_when_resumed(
    store, tmp_path, error, state
):
    tracking = started(store, tmp_path)
    assert logged(store, tmp_path).info.status == "RUNNING"
    with pytest.raises(error), closed_by(tracking):
        raise error
    stopped = logged(store, tmp_path)
    assert stopped.info.status == state
    with closed_by(started(store, tmp_path)) as tracking:
        assert logged(store, tmp_path).info.status == "RUNNING"
        tracking.finish({"success": 1.0}, [])
    assert logged(store, tmp_path).info.status == FINISHED
    assert logged(store, tmp_path).info.run_id == stopped.info.run_id


def test_a_sweep_runs_as_long_as_its_jobs_and_ends_like_the_worst(store, tmp_path):
    Launch("eval", "", multirun=True, overrides=[], configs=[{}], num_jobs=3).write(tmp_path)
    jobs = [started(store, tmp_path / name, tmp_path) for name in "01"]
    assert logged(store, tmp_path).info.status == "RUNNING"
    jobs[0].stop(KILLED)
    jobs[1].finish({}, [])
    assert logged(store, tmp_path).info.status == "RUNNING"  # the third has not begun
    started(store, tmp_path / "2", tmp_path).finish({}, [])
    assert logged(store, tmp_path).info.status == KILLED


def test_a_sweep_that_is_stopped_closes_the_jobs_that_were_killed(store, tmp_path):
    for name in "01":
        started(store, tmp_path / name, tmp_path)
    close_sweep(tmp_path, KILLED)
    assert [logged(store, tmp_path / name).info.status for name in (".", "0", "1")] == [KILLED] * 3
    close_sweep(tmp_path / "0" / "no", KILLED)  # has no MLflow run


def test_what_mlflow_cannot_keep_as_it_is_has_another_form_and_is_said_in_one_line(store, tmp_path):
    config = {"a|b": 1, "a_b": 2, "k": "v" * 9000, **{f"p{number}": number for number in range(250)}}
    metrics = {"success %": 1.0, "a//b": 2.0, "inf": float("inf"), "x" * 300: 3.0}
    with pytest.warns(UserWarning, match="MLflow at .* keeps ") as caught:
        book(store, tmp_path, config=config, metrics=metrics)
    (said,) = [str(warning.message) for warning in caught]
    for part in (
        "'a|b' as 'a_b_2'",
        "the first 6000 of the 9000 characters of k",
        "'success %' as 'success _'",
        "inf",
    ):
        assert part in said
    run = logged(store, tmp_path)
    assert {run.data.params[key] for key in ("a_b", "a_b_2")} == {"1", "2"}
    assert len(run.data.params) == 253
    assert set(run.data.metrics) == {"success _", "a/_/b", "inf", "x" * 250}
    assert run.info.status == FINISHED


def test_a_file_that_cannot_be_logged_is_named_and_costs_nothing_else(store, tmp_path):
    good = [tmp_path / "a.txt", tmp_path / "c.txt"]
    for path in good:
        path.write_text("x")
    with pytest.warns(UserWarning, match=r"not logged to MLflow at .*: b\.txt \(.*No such file") as caught:
        book(store, tmp_path, metrics={"success": 0.5}, artifacts=[good[0], tmp_path / "b.txt", good[1]])
    assert len([warning for warning in caught if warning.category is UserWarning]) == 1
    from mlflow import MlflowClient

    run = logged(store, tmp_path)
    files = MlflowClient(tracking_uri=store).list_artifacts(run.info.run_id)
    assert [file.path for file in files] == ["a.txt", "c.txt"]
    assert (run.info.status, run.data.metrics) == (FINISHED, {"success": 0.5})


def test_a_store_that_fails_while_logging_closes_the_run_as_failed(store, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("runners.tracking.mlflow.log_metrics", fail)
    with pytest.warns(
        UserWarning, match="not logged to MLflow .*; the results are on disk .*No space left"
    ) as caught:
        book(store, tmp_path)
    assert len(caught) == 1
    assert logged(store, tmp_path).info.status == FAILED
    monkeypatch.setattr("runners.tracking.mlflow.log_metrics", log_metrics)
    book(store, tmp_path)
    assert logged(store, tmp_path).info.status == FINISHED


def test_a_deleted_experiment_is_one_line_with_the_command_that_restores_it(store, tmp_path):
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=store)
    number = client.create_experiment("gone")
    client.delete_experiment(number)
    tracking = MlflowTracking(load_settings("tracking/mlflow", uri=store, experiment="gone"))
    tracking.start(CONFIG, tmp_path, {})
    with pytest.warns(UserWarning, match="the experiment gone was deleted") as caught:
        tracking.finish({"success": 1.0}, [])
    (said,) = [str(warning.message) for warning in caught]
    command = f"`MLFLOW_TRACKING_URI={store} mlflow experiments restore --experiment-id {number}`"
    assert "the experiment gone was deleted: restore it with " + command in said
    assert "the results are on disk" in said


def test_no_password_of_a_store_is_shown_or_kept(store, tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    config = {"tracking": {"uri": "http://me:p@ss/w@host:5000"}, "storage": "postgresql://me:p@ss/w@host/x"}
    book(store, tmp_path, config=config)
    assert logged(store, tmp_path).data.params == {
        "tracking.uri": "http://me:***@host:5000",
        "storage": "postgresql://me:***@host/x",
    }
    with pytest.warns(UserWarning, match="not logged to MLflow at http://") as caught:
        book("http://me:p%40ssword@127.0.0.1:1", tmp_path / "other")
    assert not any("ssword" in str(warning.message) for warning in caught)


def test_a_run_that_a_repeated_request_created_twice_is_logged_once(store, tmp_path, monkeypatch):
    from mlflow import MlflowClient

    create = MlflowClient.create_run

    def twice(self, *arguments, **options):
        create(self, *arguments, **options)
        return create(self, *arguments, **options)

    monkeypatch.setattr(MlflowClient, "create_run", twice)
    book(store, tmp_path / "0", sweep_dir=tmp_path)
    book(store, tmp_path)
    for place in (tmp_path, tmp_path / "0"):
        run = logged(store, place)
        assert run.info.lifecycle_stage == "active"
        like = f"tags.run_dir = '{place}'"
        assert len(MlflowClient(tracking_uri=store).search_runs([run.info.experiment_id], like)) == 1


def test_jobs_of_a_sweep_that_start_together_have_one_parent(store, tmp_path, monkeypatch):
    from mlflow import MlflowClient

    create = MlflowClient.create_run

    def slowly(self, *arguments, **options):
        time.sleep(0.2)
        return create(self, *arguments, **options)

    monkeypatch.setattr(MlflowClient, "create_run", slowly)
    jobs = [
        threading.Thread(target=book, args=(store, tmp_path / name), kwargs={"sweep_dir": tmp_path})
        for name in "012"
    ]
    for job in jobs:
        job.start()
    for job in jobs:
        job.join()
    parents = {logged(store, tmp_path / name).data.tags["mlflow.parentRunId"] for name in "012"}
    assert parents == {logged(store, tmp_path).info.run_id}


def test_an_experiment_that_another_process_creates_meanwhile_is_used(store, monkeypatch):
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=store)
    found = client.create_experiment("meanwhile")
    look, looks = MlflowClient.get_experiment_by_name, []

    def too_early(self, name):
        looks.append(name)
        return look(self, name) if len(looks) > 1 else None

    monkeypatch.setattr(MlflowClient, "get_experiment_by_name", too_early)
    assert experiment_id(client, store, "meanwhile") == found


@pytest.mark.parametrize("broken", ["refused", "not a database"])
def test_a_store_that_cannot_be_used_is_one_warning_that_names_it(tmp_path, broken, capfd):
    if broken == "refused":
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            uri = f"http://127.0.0.1:{free.getsockname()[1]}"
    else:
        (tmp_path / "mlflow.db").write_text("no database " * 500)
        uri = f"sqlite:///{tmp_path}/mlflow.db"
    began = time.monotonic()
    with pytest.warns(UserWarning, match="not logged to MLflow") as caught:
        book(uri, tmp_path / "run")
    assert len(caught) == 1
    message = str(caught[0].message)
    assert uri in message
    assert "\n" not in message
    assert time.monotonic() - began < 30
    assert capfd.readouterr().err == ""


def test_a_server_that_never_answers_is_given_up_on(tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "1")
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.warns(UserWarning, match="not logged"):
            book(f"http://127.0.0.1:{silent.getsockname()[1]}", tmp_path)


def test_a_store_whose_making_was_interrupted_is_made_again(tmp_path):
    """What is at the store's place is whole at any moment, or is not there."""
    uri = f"sqlite:///{tmp_path}/mlflow.db"
    script = f"from runners.tracking.store import open_client; open_client({uri!r})"
    process = subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, env={**os.environ, **DEFAULTS})
    while not list(tmp_path.glob(".mlflow.db.*")):
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert not (tmp_path / "mlflow.db").exists()
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        book(uri, tmp_path / "run")
    assert logged(uri, tmp_path / "run").info.status == "FINISHED"


@pytest.mark.parametrize("uri", ["file:outputs/mlruns", "outputs/mlflow.db", ""])
def test_a_uri_that_mlflow_cannot_use_is_refused(uri):
    with pytest.raises(InputError, match=r"^tracking\.uri is .*such as sqlite:///outputs/mlflow\.db"):
        load_settings("tracking/mlflow", uri=uri)


def test_tracking_none_does_nothing(tmp_path):
    tracking = NoTracking(NoTrackingConfig())
    threads = threading.active_count()
    tracking.start(CONFIG, tmp_path, {})
    tracking.finish({"success": 1.0}, [])
    assert threading.active_count() == threads
    assert list(tmp_path.iterdir()) == []


def test_importing_the_module_does_not_import_mlflow():
    script = "import sys, runners.tracking.mlflow; sys.exit('mlflow' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT).returncode == 0
