"""Clusters started by command line as a user would, and processes that end."""

from __future__ import annotations

import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Future
from pathlib import Path

import pytest

import brachis
from brachis.apps.sweeps.plans import Outcome
from brachis.apps.sweeps.pools import as_completed, on_dask, pool_for
from brachis.errors import ClusterError, InputError

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
                    Outcome({"status": "verified", "t_end_s": float(plan)})
                )
        self.running.clear()


def test_a_plan_that_ends_its_process_fails_and_no_other(monkeypatch):
    processes = Processes({4, 7})

    def wait(futures, *_settings):
        if not any(future.done() for future in futures):
            processes.work()
        return {future for future in futures if future.done()}, None

    monkeypatch.setattr("brachis.apps.sweeps.pools.wait", wait)
    found = dict(as_completed(range(10), processes.submit, lambda: 3))
    assert sorted(found) == list(range(10))
    assert processes.most == 3
    assert {
        plan for plan, outcome in found.items() if outcome.facts["status"] == "failed"
    } == {4, 7}
    assert found[4].facts["error"] == "BrokenExecutor"
    assert "each worker process ended during this plan" in found[4].facts["message"]


def test_what_no_worker_can_run_ends_the_sweep():
    future = Future()
    future.set_exception(ModuleNotFoundError("No module named 'brachis'"))
    with pytest.raises(
        ClusterError,
        match="workers failed to make plans; found ModuleNotFoundError: No module",
    ):
        next(as_completed([0], lambda _plan: future, lambda: 1))


@pytest.mark.parametrize(
    ("jobs", "scheduler", "expected"),
    [
        (0, None, "jobs: out of range; found 0; allowed: a whole number >= 1"),
        (2, "tcp://127.0.0.1:8786", "jobs or scheduler"),
    ],
)
def test_wrong_pools_are_refused(jobs, scheduler, expected):
    with pytest.raises(InputError, match=expected):
        pool_for(jobs, scheduler, print)


@pytest.fixture
def cluster(tmp_path):
    """A scheduler's file, and two workers; all end with the test."""
    pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install 'brachis[cluster]'"
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


def test_a_sweep_on_dask_survives_a_worker_that_is_killed(
    cluster, content, tmp_path, same_as_undisturbed
):
    file, workers = cluster
    until = time.monotonic() + WAIT
    while not file.exists():
        assert time.monotonic() < until
        time.sleep(0.05)

    def listener(text):
        if text.startswith("1 of"):
            workers[0].kill()

    result = brachis.sweep(
        content, tmp_path / "out", scheduler=str(file), listener=listener
    )
    assert same_as_undisturbed(result.table)
    assert workers[0].wait(WAIT) == -9
    assert workers[1].poll() is None


def test_no_scheduler_answers(content, tmp_path, monkeypatch):
    pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install 'brachis[cluster]'"
    )
    monkeypatch.setattr("brachis.apps.sweeps.pools._CONNECTING", 0.1)
    with pytest.raises(
        ClusterError, match=r"tcp://127\.0\.0\.1:9: no Dask scheduler answers"
    ):
        brachis.sweep(content, tmp_path / "out", scheduler="tcp://127.0.0.1:9")


def test_a_scheduler_that_is_lost(monkeypatch):
    """The client says so with an error of its own, whatever it is asked for."""
    distributed = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install 'brachis[cluster]'"
    )

    class Client:
        def __init__(self, **_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def nthreads(self):
            raise distributed.comm.CommClosedError(
                "in <TCP (closed)>: Connection reset by peer"
            )

    monkeypatch.setattr("dask.distributed.Client", Client)
    with pytest.raises(
        ClusterError,
        match=r"tcp://here:1: the connection to the Dask scheduler was lost; found in <TCP .closed.*it continues",
    ):
        list(on_dask([], "tcp://here:1", print))
