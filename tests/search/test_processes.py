"""Work for several processes."""

import os
import signal
import time
from concurrent.futures import wait
from functools import partial
from itertools import count
from types import SimpleNamespace

import pytest

from brachis.errors import BrachisError, PathError
from brachis.search import processes
from brachis.search.processes import process_count, run_in_processes


class Unsendable:
    """What cannot be pickled."""

    def __len__(self):
        return 7

    def __reduce__(self):
        raise TypeError("cannot be sent")


def length(item, _listener):
    return len(item)


def end_if_elsewhere(own, _listener):
    if os.getpid() != own:
        os._exit(3)


def say(item, listener):
    listener(str(item))
    return item


def refuse(item, _listener):
    if item == 2:
        raise PathError("refused")
    return item


@pytest.fixture
def workers():
    """Another process, ready, in place of any that was started before."""
    processes._start_workers.cache_clear()
    found = processes._start_workers(1, os.getpid())
    wait(found._starting)
    yield found
    processes._start_workers.cache_clear()


@pytest.mark.usefixtures("workers")
def test_work_is_shared_and_comes_back_in_order():
    here = []
    made = run_in_processes(say, range(20), jobs=2, listener=here.append)
    assert list(made) == list(range(20))
    assert "0" not in here  # the first one was handed out
    assert 0 < len(here) < 20


@pytest.mark.usefixtures("workers")
@pytest.mark.parametrize("seconds, here", [(0.3, "123"), (0.5, "13")])
def test_auto_shares_what_takes_long(monkeypatch, seconds, here):
    """Of three the first tells how long the others take."""
    clock = SimpleNamespace(perf_counter=partial(next, count(step=seconds)))
    monkeypatch.setattr("brachis.search.processes.time", clock)
    monkeypatch.setattr("joblib.cpu_count", lambda: 2)
    said = []
    made = run_in_processes(say, [1, 2, 3], jobs="auto", listener=said.append)
    assert list(made) == [1, 2, 3]
    assert "".join(said) == here


def test_there_are_never_more_processes_than_processors(monkeypatch):
    monkeypatch.setattr("joblib.cpu_count", lambda: 2)
    assert [process_count(jobs) for jobs in (1, 2, 3, "auto")] == [1, 2, 2, 2]


@pytest.mark.usefixtures("workers")
def test_work_that_cannot_be_sent_is_done_here():
    given = [Unsendable(), Unsendable(), Unsendable()]
    assert list(run_in_processes(length, given, jobs=2, listener=print)) == [7, 7, 7]


@pytest.mark.usefixtures("workers")
def test_a_process_that_ends_is_said_so():
    given = [os.getpid(), os.getpid()]
    with pytest.raises(BrachisError, match=r"ended before its work was done.*jobs: 1"):
        list(run_in_processes(end_if_elsewhere, given, jobs=2, listener=print))


@pytest.mark.usefixtures("workers")
def test_an_error_comes_in_its_turn():
    made = run_in_processes(refuse, range(5), jobs=2, listener=print)
    assert [next(made), next(made)] == [0, 1]
    with pytest.raises(PathError, match="refused"):
        next(made)


def test_nobody_waits_for_processes_to_start(monkeypatch):
    monkeypatch.setattr(processes._Workers, "count_free", lambda _: 0)
    here = []
    made = run_in_processes(say, [1, 2, 3], jobs=2, listener=here.append)
    assert list(made) == [1, 2, 3]
    assert here == ["1", "2", "3"]


@pytest.mark.usefixtures("workers")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_starts_processes_of_its_own():
    child = os.fork()
    if child == 0:
        made = run_in_processes(say, range(4), jobs=2, listener=print)
        os._exit(0 if list(made) == [0, 1, 2, 3] else 1)
    try:
        ended = 0
        for _ in range(600):
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                break
            time.sleep(0.1)
        assert ended, "it hangs"
        assert os.waitstatus_to_exitcode(status) == 0
    finally:
        if not ended:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
