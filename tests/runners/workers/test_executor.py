"""Executors: the same results from any of them, and what happens when something goes wrong."""

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from multiprocessing import get_context

import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.records.episode_record import EpisodeKey
from runners.workers import episodes
from runners.workers.executor import (
    EpisodeError,
    ProcessExecutor,
    SerialConfig,
    SerialExecutor,
    WorkerDiedError,
    available_cores,
)
from tests.hearing import hear_signals
from tests.places import ROOT

ITEMS = [EpisodeKey(world, run) for run in range(3) for world in range(7)]
ONE_RUN = ITEMS[:7]  # world 3 fails once: with more runs, any of its failures may come first


def multiply(payload):
    built_in = os.getpid()

    def run(item):
        return item, payload["factor"] * item.world + item.run, built_in == os.getpid()

    return run


def fail_in_world_3(error):
    def run(item):
        if item.world == 3:
            raise error
        return item

    return run


def die_in_world_3(payload):
    def run(item):
        if item.world == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return item

    return run


def refuse_to_build(payload):
    raise InputError("robot.v_max is -1: must be greater than 0")


def worker_environment(payload):
    return lambda item: (os.environ["NUMBA_NUM_THREADS"], os.environ["OMP_NUM_THREADS"], os.getpid())


def sleep_long(payload):
    def run(item):
        os.write(1, b"started\n")  # in one piece: the workers share the pipe
        time.sleep(60)

    return run


def name_itself_and_sleep(payload):
    def run(item):
        os.write(1, b"%d\n" % os.getpid())
        time.sleep(60)

    return run


def processes(workers=2):
    return ProcessExecutor(load_settings("executor/process", workers=workers))


def test_items_are_taken_when_a_worker_is_free():
    taken = []
    items = (taken.append(item) or item for item in ITEMS)
    results = ProcessExecutor(load_settings("executor/process", workers=2)).map(
        multiply, {"factor": 10}, items
    )
    next(results)
    assert len(taken) <= 4  # two at work, and the next of a worker that was done
    assert len(list(results)) == len(ITEMS) - 1


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes(1), processes(3)])
def test_every_executor_gives_the_same_results(executor):
    results = sorted(executor.map(multiply, {"factor": 10}, iter(ITEMS)))
    assert results == sorted((item, 10 * item.world + item.run, True) for item in ITEMS)


def test_no_items_need_no_workers():
    assert list(processes().map(multiply, {"factor": 1}, [])) == []


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes()])
def test_an_input_error_stays_one_and_names_its_episode(executor, says):
    with says.raises(InputError):
        list(executor.map(fail_in_world_3, InputError("the start is inside an obstacle"), ONE_RUN))


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes()])
@pytest.mark.parametrize("error", [ZeroDivisionError("oops"), SystemExit("oops"), StopIteration("oops")])
def test_an_error_of_a_users_own_code_names_its_episode_file_and_line(executor, error):
    said = rf"^world 3, run 0: \S*test_executor\.py:\d+: {type(error).__name__}: oops \(LME_TRACEBACK=1 .*\)$"
    with pytest.raises(EpisodeError, match=said):
        list(executor.map(fail_in_world_3, error, ONE_RUN))


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes()])
def test_the_traceback_is_there_for_whoever_asks(executor):
    with pytest.raises(EpisodeError) as caught:
        list(executor.map(fail_in_world_3, ZeroDivisionError("oops"), ONE_RUN))
    assert "Traceback" in caught.value.trace
    assert "raise error" in caught.value.trace


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes()])
def test_an_error_of_lme_itself_brings_the_workers_traceback(executor):
    with pytest.raises(EpisodeError, match=r"^AttributeError: .*\nTraceback(.|\n)*episodes\.py"):
        list(executor.map(episodes.initialise, None, ITEMS))


@pytest.mark.parametrize("executor", [SerialExecutor(SerialConfig()), processes()])
def test_a_config_that_cannot_be_built_is_reported_as_it_is(executor, says):
    with says.raises(InputError, match="v_max.*-1"):
        list(executor.map(refuse_to_build, None, ITEMS))


def test_a_killed_worker_is_named_with_its_episode_and_earlier_results_are_out():
    iterator = processes(1).map(die_in_world_3, None, ITEMS)
    assert [next(iterator) for _ in range(3)] == ITEMS[:3]
    with pytest.raises(WorkerDiedError, match=r"world 3, run 0 died \(SIGKILL\).*resume=true"):
        next(iterator)


def test_workers_run_one_thread_each_and_this_process_keeps_its_environment(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    before = dict(os.environ)
    results = list(processes(2).map(worker_environment, None, ITEMS))
    assert {result[:2] for result in results} == {("1", "1")}
    assert os.getpid() not in {result[2] for result in results}
    assert dict(os.environ) == before


def test_leaving_early_stops_the_workers():
    iterator = processes(2).map(worker_environment, None, ITEMS)
    _, _, worker = next(iterator)
    iterator.close()
    with pytest.raises(ProcessLookupError):
        _wait_until_gone(worker)


def _wait_until_gone(pid, limit_s=10.0):
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        os.kill(pid, 0)
        time.sleep(0.02)


def test_the_server_of_workers_does_not_hear_sigterm_which_comes_to_all_processes():
    program = (
        "import os, signal; from multiprocessing import forkserver as f; from runners.workers import forkserver; "
        "forkserver.start(); pid = f._forkserver._forkserver_pid; os.kill(pid, signal.SIGTERM); "
        "import time; time.sleep(0.5); print(os.waitpid(pid, os.WNOHANG))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert run.stdout == "(0, 0)\n"  # still alive


def test_a_launchers_worker_process_runs_the_items_itself(says):
    """It may be one that can start no others; the reason is said once."""
    with get_context("forkserver").Pool(1) as launcher:
        (first, reason), (second, silence) = (launcher.apply(run_inside) for _ in range(2))
        launcher.close()  # its process may be one of our server, which does not hear SIGTERM
        launcher.join()
    assert first == second == [(item, True) for item in ITEMS]
    says(reason)
    assert silence == ""


def run_inside():
    with contextlib.redirect_stderr(io.StringIO()) as said, processes(2).open(name_process, None) as run_all:
        return [(item, process == os.getpid()) for item, process in run_all(ITEMS)], said.getvalue()


def test_number_of_workers(says):
    assert processes(5).workers == 5
    assert processes(None).workers == available_cores() >= 1
    with says.raises(InputError, match="workers.*0"):
        load_settings("executor/process", workers=0)


COORDINATOR = """
import time
from lme.config.presets import load_settings
from runners.workers.executor import ProcessExecutor
from tests.runners.workers.test_executor import name_itself_and_sleep, sleep_long, worker_environment

if __name__ == "__main__":
    iterator = ProcessExecutor(load_settings("executor/process", workers=2)).map(JOB, None, [(0, 0), (1, 0)])
    try:
        print(next(iterator)[-1], flush=True)
        time.sleep(60)
    except KeyboardInterrupt:
        print("stopped", flush=True)
"""


@pytest.fixture
def coordinate(tmp_path):
    """Start a process of its own group that runs a job on two workers."""
    started = []

    def start(job):
        script = tmp_path / "coordinator.py"
        script.write_text(COORDINATOR.replace("JOB", job))
        process = subprocess.Popen(
            [sys.executable, str(script)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=hear_signals,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_ctrl_c_stops_everything_at_once_and_workers_print_nothing(coordinate):
    process = coordinate("sleep_long")
    assert [process.stdout.readline() for _ in range(2)] == ["started\n"] * 2
    began = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process of the group
    assert process.communicate(timeout=20) == ("stopped\n", "")
    assert time.monotonic() - began < 10


def test_workers_of_a_killed_coordinator_end_by_themselves(coordinate):
    process = coordinate("worker_environment")
    worker = int(process.stdout.readline())
    os.kill(worker, 0)
    process.kill()
    with pytest.raises(ProcessLookupError):
        _wait_until_gone(worker)


def test_workers_of_a_killed_coordinator_end_in_the_middle_of_an_episode(coordinate):
    process = coordinate("name_itself_and_sleep")
    workers = [int(process.stdout.readline()) for _ in range(2)]
    process.kill()
    for worker in workers:
        with pytest.raises(ProcessLookupError):
            _wait_until_gone(worker)


@pytest.mark.parametrize(
    "executor",
    [SerialExecutor(SerialConfig()), ProcessExecutor(load_settings("executor/process", workers=2))],
)
def test_an_open_executor_serves_list_after_list(executor):
    """By the same processes: what they hold is built once."""
    with executor.open(name_process, None) as run_all:
        lists = [sorted(run_all(range(count))) for count in (5, 0, 3)]
    assert [[item for item, _ in found] for found in lists] == [[0, 1, 2, 3, 4], [], [0, 1, 2]]
    assert {process for _, process in lists[2]} <= {process for _, process in lists[0]}


def name_process(payload):
    return lambda item: (item, os.getpid())
