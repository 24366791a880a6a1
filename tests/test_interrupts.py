"""Ctrl-C that is never lost."""

import os
import signal
import sys
import threading

import pytest

import brachis
from brachis.common import interrupts
from support.scripts import output_of


@pytest.fixture
def presses(monkeypatch):
    """The command line's handler, in place for the test."""
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(sys, "unraisablehook", lambda _unraisable: None)
    interrupts.install()
    yield interrupts.sigint_handler()
    signal.signal(signal.SIGINT, before)


def press():
    os.kill(os.getpid(), signal.SIGINT)


def test_a_press_is_only_remembered_until_it_may_be_heard(presses):
    press()
    assert presses.pending
    with pytest.raises(KeyboardInterrupt), interrupts.interruptible():
        pytest.fail("a press before should be heard first")
    assert not presses.raising


@pytest.mark.usefixtures("presses")
def test_a_press_interrupts():
    def command():
        with interrupts.interruptible():
            press()
            pytest.fail("not interrupted")

    with pytest.raises(KeyboardInterrupt):
        command()


class Finaliser:
    def __del__(self):
        press()


def swallowed_by_a_finaliser():
    Finaliser()


def swallowed_by_a_library():
    try:
        press()
    except BaseException as error:
        raise ImportError("could not be imported") from error


@pytest.mark.parametrize("lose", [swallowed_by_a_finaliser, swallowed_by_a_library])
def test_a_press_that_is_swallowed_is_heard_in_the_end(presses, lose):
    after = []

    def command():
        with interrupts.interruptible():
            lose()
            after.append(1)
            interrupts.check()
            after.append(2)

    with pytest.raises(KeyboardInterrupt):
        command()
    assert 2 not in after
    assert presses.pending


def test_what_was_heard_is_forgotten(presses):
    with interrupts.interruptible():
        with pytest.raises(KeyboardInterrupt):
            press()
        interrupts.clear()
    interrupts.check()
    assert not presses.pending


@pytest.mark.parametrize(
    "hold, listening",
    [
        (interrupts.defer, True),
        (interrupts.defer, False),
        (interrupts.block_in_children, False),
    ],
)
def test_a_press_waits_for_the_end_of_a_block(request, hold, listening):
    handler = (
        request.getfixturevalue("presses")
        if listening
        else signal.getsignal(signal.SIGINT)
    )
    done = []

    def work():
        with hold():
            press()
            done.append("the block")
        done.append("what follows")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["the block"]
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_block_ends_with_the_press_whatever_it_raises():
    def work():
        with interrupts.defer():
            press()
            raise ImportError("could not be imported")

    with pytest.raises(KeyboardInterrupt):
        work()


def test_other_threads_postpone_nothing():
    seen = []

    def work():
        with interrupts.defer():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]


def test_processes_begun_in_a_blocked_block_do_not_hear_a_press():
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    for block in (True, False):
        with interrupts.block_in_children() if block else interrupts.defer():
            printed = output_of("-c", code)
        assert printed.strip() == str(block)


def test_a_press_ends_all_plans_also_where_one_returns_what_it_has(monkeypatch):
    begun = []

    def plan(_robot, task, **_keywords):
        begun.append(task)
        interrupts.clear()  # as a plan that ends with its best motion does
        return "a result"

    monkeypatch.setattr("brachis.planner.plan", plan)
    with pytest.raises(KeyboardInterrupt):
        brachis.plan_many(["a", "b"])
    assert begun == ["a"]
