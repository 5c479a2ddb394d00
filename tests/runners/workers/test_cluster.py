"""The dask executor: the results of the others, lost workers, a lost scheduler, and what a user can put right."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.cli.main import main
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.records.records import read_episodes
from runners.workers import cluster as module
from runners.workers import episodes
from runners.workers.executor import EpisodeError, SerialConfig, SerialExecutor, WorkerDiedError
from tests.composing import jobs_of
from tests.places import ROOT
from tests.runners.workers.test_executor import (
    ITEMS,
    ONE_RUN,
    fail_in_world_3,
    multiply,
    name_process,
    refuse_to_build,
)

pytest.importorskip("distributed")
import dask
from distributed import KilledWorker, LocalCluster
from distributed.comm.core import CommClosedError

pytestmark = pytest.mark.usefixtures("undrawn")

WORDS = ["map=traps", "robot=stage", "map.time_limit=2", "runs=5", "tracking=none"]
LABELS = RunLabels(**dict.fromkeys(RunLabels.__slots__, ""))
TIMINGS = {"wall_s": 0.0, "decision_us_p50": 0.0, "decision_us_p99": 0.0}  # no two runs have the same


@pytest.fixture(scope="module")
def address():
    """Of a cluster of two workers, in which a task may lose one worker."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=50
        ) as cluster,
    ):
        yield cluster.scheduler_address


@pytest.fixture
def executor(address):
    return module.DaskExecutor(load_settings("executor/dask", address=address))


def test_a_busy_machine_may_take_long_to_answer_in_a_cluster_of_its_own(monkeypatch):
    monkeypatch.setattr(module, "_CONNECT_S", 1e-6)
    own = module.DaskExecutor(load_settings("executor/dask", workers=1))
    assert len(list(own.map(multiply, {"factor": 3}, ITEMS))) == len(ITEMS)


def test_the_records_are_those_of_a_serial_run_bit_for_bit(executor):
    with jobs_of("eval", *WORDS) as job_of:
        config = job_of().config
    payload = episodes.EpisodePayload(config, LABELS, None)
    keys = [EpisodeKey(world, run) for world in range(3) for run in range(2)]
    one_worker = module.DaskExecutor(load_settings("executor/dask", workers=1))
    serial, *others = (
        {result.record.key: result for result in each.map(episodes.initialise, payload, keys)}
        for each in (SerialExecutor(SerialConfig()), executor, one_worker)
    )
    assert serial.keys() == set(keys)
    for other in others:
        assert other.keys() == serial.keys()
        for key, result in serial.items():
            assert repr(replace(other[key].record, **TIMINGS)) == repr(replace(result.record, **TIMINGS))
            np.testing.assert_array_equal(other[key].trajectory, result.trajectory)


def test_every_item_has_one_result_and_each_worker_builds_once(executor):
    results = sorted(executor.map(multiply, {"factor": 10}, iter(ITEMS)))
    assert results == sorted((item, 10 * item.world + item.run, True) for item in ITEMS)


def test_an_open_executor_serves_list_after_list(executor):
    with executor.open(name_process, None) as run_all:
        lists = [sorted(run_all(range(count))) for count in (20, 0, 3)]
    assert [[item for item, _ in found] for found in lists] == [[*range(20)], [], [0, 1, 2]]
    assert len({process for _, process in lists[0]}) == 2


@pytest.mark.parametrize(
    ("initialise", "payload", "kind", "message"),
    [
        (fail_in_world_3, InputError("the start is inside"), InputError, r"^world 3, run 0: the start is inside$"),
        (fail_in_world_3, ZeroDivisionError("oops"), EpisodeError, r"^world 3, run 0: \S+: ZeroDivisionError: oops"),
        (refuse_to_build, None, InputError, r"^robot\.v_max is -1: must be greater than 0$"),
    ],
)  # fmt: skip
def test_errors_of_a_worker_arrive_as_with_the_process_executor(executor, initialise, payload, kind, message):
    with pytest.raises(kind, match=message):
        list(executor.map(initialise, payload, ONE_RUN))


def test_results_before_an_error_in_the_same_batch_are_delivered(executor):
    found = []
    with (
        executor.open(fail_in_world_3, InputError("no")) as run_all,
        pytest.raises(InputError, match="world 3"),
    ):
        found.extend(run_all([EpisodeKey(world, 0) for world in (0, 1, 3)] * 8))
    assert found


def die_once(marker):
    def run(item):
        if item.world == 3 and not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return item

    return run


def test_the_episodes_of_a_killed_worker_run_again(executor, tmp_path):
    assert sorted(executor.map(die_once, tmp_path / "died", ITEMS)) == sorted(ITEMS)
    assert (tmp_path / "died").exists()


def test_episodes_that_lose_worker_after_worker_are_named():
    future = Future()
    future.set_exception(KilledWorker("task", None, 3))
    with pytest.raises(
        WorkerDiedError, match=r"^4 workers died with world 3, run 0; world 4, run 0 .*resume=true"
    ):
        module._receive(future, ONE_RUN[3:5])


def test_a_worker_with_another_version_is_named(executor, monkeypatch):
    monkeypatch.setattr(module, "versions", lambda *names: {"python": "3.99.0", "lme": "9.9"})
    message = r"the worker tcp://\S+ has python 3\.1\S+, lme \S+: must have python 3\.99\.0, lme 9\.9"
    with pytest.raises(InputError, match=message):
        list(executor.map(multiply, {"factor": 1}, ITEMS))


def test_a_worker_of_several_threads_is_named():
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as cluster:
        threads = module.DaskExecutor(load_settings("executor/dask", address=cluster.scheduler_address))
        with pytest.raises(InputError, match=r"has 2 threads: must have one; start it with --nthreads 1"):
            list(threads.map(multiply, {"factor": 1}, ITEMS))


DYING = """
import os, signal, threading, time
from pathlib import Path

marks = Path(__file__).parent
if len(list(marks.glob("*.mark"))) >= int(os.environ["LIVES"]):
    os.kill(os.getpid(), signal.SIGKILL)
(marks / f"{os.getpid()}.mark").touch()

def dask_setup(worker):
    threading.Thread(target=lambda: (time.sleep(1), os.kill(os.getpid(), signal.SIGKILL)), daemon=True).start()
"""


def sleep_long(payload):
    return lambda item: time.sleep(60)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lives", "message"), [(0, "no worker process starts"), (2, "all worker processes died")]
)
def test_a_cluster_whose_processes_die_ends_the_run(tmp_path, monkeypatch, lives, message):
    """At once, or once the processes that are started again die as they start."""
    (tmp_path / "dying.py").write_text(DYING)
    monkeypatch.setenv("LIVES", str(lives))
    monkeypatch.setattr(module, "_NO_WORKER_S", 1)
    dying = module.DaskExecutor(load_settings("executor/dask", workers=2))
    preload = {"distributed.worker.preload": [str(tmp_path / "dying.py")]}
    with dask.config.set(preload), pytest.raises(WorkerDiedError, match=message):
        list(dying.map(sleep_long, None, ITEMS))


def test_an_address_where_nobody_answers(monkeypatch, says):
    monkeypatch.setattr(module, "_CONNECT_S", 0.3)
    nobody = module.DaskExecutor(load_settings("executor/dask", address="tcp://127.0.0.1:9"))
    with says.raises(InputError):
        list(nobody.map(multiply, {"factor": 1}, ITEMS))


def test_a_connection_that_ends_during_a_result_is_reported():
    class Cut:
        def result(self):
            raise CommClosedError("in <TCP (closed)>: ConnectionResetError")

    with pytest.raises(WorkerDiedError, match="the dask scheduler is gone: finished episodes are kept"):
        module._receive(Cut(), ITEMS)


@pytest.mark.parametrize(
    "settings",
    [
        {"address": "host"},
        {"workers": 0},
        {"batch": 0},
        {"address": "tcp://host:8786", "workers": 2},
    ],
    ids=str,
)  # fmt: skip
def test_settings_are_checked(settings, says):
    with says.raises(InputError):
        load_settings("executor/dask", **settings)


def test_a_long_list_is_submitted_in_parts(executor, monkeypatch):
    """The scheduler of a million episodes would otherwise need gigabytes."""
    monkeypatch.setattr(module, "_IN_FLIGHT", 2)
    items = [EpisodeKey(world, 0) for world in range(50)]
    results = [result for _, result, _ in executor.map(multiply, {"factor": 10}, iter(items))]
    assert sorted(results) == [10 * world for world in range(50)]


def test_a_short_list_goes_to_every_worker():
    assert [module._batch_size(count, 2, 4) for count in (1, 8, 9, 24, 300)] == [1, 1, 2, 3, 4]
    assert module._batch_size(300, 0, 4) == 4  # before the first worker has come


@pytest.fixture
def own_cluster():
    """The process of a scheduler, with one worker, and its address."""
    script = (
        "from distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    cluster = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address='127.0.0.1:0')\n"
        "    print(cluster.scheduler_address, flush=True)\n"
        "    input()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    yield process, process.stdout.readline().strip()
    process.kill()
    process.communicate()


def _kill_at_first_record(process, run_dir: Path):
    while not any(path.stat().st_size for path in run_dir.glob("parts/episodes.jsonl")):
        time.sleep(0.005)
    process.kill()


def test_a_run_whose_scheduler_is_killed_continues_with_another_executor(
    own_cluster, tmp_path, monkeypatch, capsys
):
    process, scheduler = own_cluster
    monkeypatch.chdir(tmp_path)
    cluster = ["executor=dask", f"executor.address={scheduler}", "executor.batch=1"]
    killer = threading.Thread(target=_kill_at_first_record, args=(process, Path("cut")))
    killer.start()
    assert main(["eval", *WORDS, *cluster, "hydra.run.dir=cut"]) == 1
    killer.join()
    assert "the dask scheduler is gone: finished episodes are kept" in capsys.readouterr().err
    done = len(read_episodes([Path("cut")]))
    assert 0 < done < 100
    assert main(["eval", *WORDS, "executor=serial", "hydra.run.dir=cut", "resume=true"]) == 0
    assert len(read_episodes([Path("cut")])) == 100
