"""Clusters started by command line as a user would, and processes that end."""

import subprocess
import sys
import time
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from multiprocessing import get_context
from pathlib import Path

import pytest

import brachis
from brachis.apps.sweeps.plans import PlanOutcome
from brachis.apps.sweeps.pools import as_completed, on_executor, pool_for
from brachis.errors import ClusterError, InputError, TaskError

DASK = Path(sys.executable).with_name("dask")
WAIT = 120.0


class Processes:
    """Plans are numbers; those in `deadly` end the process that makes them, with all that are under way beside them."""

    def __init__(self, deadly):
        self.deadly, self.running, self.most = deadly, {}, 0

    def submit(self, plan):
        self.running[plan] = future = Future()
        self.most = max(self.most, len(self.running))
        if len(self.running) == 3 or plan >= 9:
            self.work()
        return future

    def work(self):
        broken = self.deadly & set(self.running)
        for plan, future in self.running.items():
            if broken:
                future.set_exception(BrokenExecutor("killed"))
            else:
                future.set_result(
                    PlanOutcome({"status": "verified", "t_end_s": float(plan)})
                )
        self.running.clear()


def test_a_plan_that_ends_its_process_fails_and_no_other(monkeypatch):
    processes = Processes({4, 7})

    monkeypatch.setattr(
        "brachis.apps.sweeps.pools.time.sleep", lambda _: processes.work()
    )
    outcomes = dict(as_completed(range(10), processes.submit, 3))
    assert processes.most == 3
    facts = [outcomes[plan].facts for plan in range(10)]
    failures = [plan for plan in range(10) if facts[plan]["status"] == "failed"]
    assert failures == [4, 7]
    assert facts[4]["error"] == "BrokenExecutor"
    assert "every worker process ended during this plan" in facts[4]["message"]


@pytest.mark.parametrize(
    "failure",
    [
        ModuleNotFoundError("No module named 'brachis'"),
        ConnectionResetError("Connection reset by peer"),
        CancelledError("lost"),
    ],
    ids=type,
)
def test_what_no_worker_can_run_ends_the_sweep(failure):
    future = Future()
    future.set_exception(failure)
    expected = f"workers failed to make plans; found {type(failure).__name__}: {failure}.*same sweep again"
    with pytest.raises(ClusterError, match=expected):
        next(as_completed([0], lambda _plan: future, 1))


def test_a_plan_that_its_workers_did_not_survive_fails_alone():
    """Dask says so by an error that only Dask has."""
    answers = {0: Future(), 1: Future()}
    answers[0].set_exception(RuntimeError("killed four workers"))
    answers[1].set_result(PlanOutcome({"status": "verified"}))
    outcomes = dict(as_completed([0, 1], answers.get, 2))
    assert outcomes[0].facts["status"] == "failed"
    assert outcomes[0].facts["message"] == "killed four workers"
    assert outcomes[1].facts["status"] == "verified"


def test_an_executor_without_workers_is_an_error():
    class Executor:
        def submit(self, *_):
            raise BrokenExecutor("a child process terminated abruptly")

    expected = "workers ended; found a child process terminated abruptly"
    with pytest.raises(ClusterError, match=expected):
        list(on_executor([0], Executor()))


def test_plans_that_wait_are_cancelled_with_the_sweep():
    future = Future()
    done = Future()
    done.set_result(PlanOutcome({"status": "verified"}))
    outcomes = as_completed([0, 1], {0: done, 1: future}.get, 2)
    next(outcomes)
    outcomes.close()
    assert future.cancelled()


@pytest.mark.parametrize(
    "jobs, executor, expected",
    [
        (0, None, "jobs: out of range; found 0; allowed: a whole number >= 1"),
        (2, ThreadPoolExecutor(1), "jobs or executor"),
        (None, "tcp://here", "executor: wrong type; found 'tcp://here'; allowed: an"),
    ],
)
def test_wrong_pools_are_errors(jobs, executor, expected):
    with pytest.raises(InputError, match=expected):
        pool_for(jobs, executor)


class Job:
    """What submitit gives: no future, but like one."""

    def __init__(self, outcome):
        self.outcome, self.looks = outcome, 0

    def done(self):
        self.looks += 1
        return self.looks > 2

    def exception(self):
        return None

    def result(self):
        return self.outcome


class Cluster:
    """An executor as submitit has, which is none of `concurrent.futures`."""

    def submit(self, function, *arguments):
        return Job(function(*arguments))


def test_any_executor_makes_the_plans(content, tmp_path, same_as_undisturbed):
    result = brachis.sweep(content, tmp_path / "out", executor=Cluster())
    assert same_as_undisturbed(result.table)


def test_an_executor_plans_many_tasks():
    tasks = [
        {"brachis": 1, "path": []},
        brachis.load_task(brachis.examples.scara_line, changes={"spline.intervals": 6}),
    ]
    keywords = {"redundant_joints": ["j1"], "effort": "single"}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        wrong, result = brachis.plan_many(tasks, executor=executor, **keywords)
    assert isinstance(wrong, TaskError)
    alone = brachis.plan(tasks[1], **keywords)
    assert result.verified
    assert result.t_end == pytest.approx(alone.t_end, rel=1e-9)
    with pytest.raises(InputError, match="executor: wrong type; found 3"):
        brachis.plan_many(tasks, executor=3)


@pytest.fixture
def cluster(tmp_path):
    """A scheduler's file, and two workers; all end with the test."""
    pytest.importorskip(
        "distributed", reason="Dask is not installed: the extra cluster"
    )
    file = tmp_path / "scheduler.json"
    common = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    commands = [[DASK, "scheduler", "--port", "0", *common]]
    commands += [[DASK, "worker", "--nthreads", "1", "--no-nanny", *common]] * 2
    started = []
    try:
        with (tmp_path / "cluster.log").open("w") as log:
            started += [
                subprocess.Popen(command, cwd=tmp_path, stdout=log, stderr=log)
                for command in commands
            ]
        yield file, started[1:]
    finally:
        for process in started:
            process.kill()
        for process in started:
            process.wait(WAIT)


def test_a_sweep_on_dask_survives_the_end_of_a_worker(
    cluster, content, tmp_path, same_as_undisturbed
):
    from distributed import Client

    file, workers = cluster
    until = time.monotonic() + WAIT
    while not file.exists():
        assert time.monotonic() < until
        time.sleep(0.05)

    def listener(text):
        if text.startswith("1 of"):
            workers[0].kill()

    with Client(scheduler_file=str(file), set_as_default=False) as client:
        result = brachis.sweep(
            content, tmp_path / "out", executor=client, listener=listener
        )
    assert same_as_undisturbed(result.table)
    assert workers[0].wait(WAIT) == -9
    assert workers[1].poll() is None
