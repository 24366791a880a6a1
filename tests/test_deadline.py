"""When to end."""

import math

import pytest

from brachis.common.deadline import NEVER, Deadline


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still at 100 s unless it is set."""
    now = [100.0]
    monkeypatch.setattr("brachis.common.deadline.time.monotonic", lambda: now[0])
    return now


def test_the_time_to_a_deadline(clock):
    deadline = Deadline.after(10.0)
    assert (deadline.at, deadline.left, deadline.passed) == (110.0, 10.0, False)
    clock[0] = 111.0
    assert (deadline.left, deadline.passed) == (0.0, True)


def test_never(clock):
    clock[0] = 1e12
    assert not NEVER.passed
    assert NEVER.left == math.inf
    assert NEVER.within(3.0).left == 3.0


def test_parts_and_extensions(clock):
    deadline = Deadline.after(10.0)
    clock[0] = 102.0
    assert deadline.part(0.5).at == 106.0
    assert deadline.within(3.0).at == 105.0
    assert deadline.within(30.0) == deadline
    assert deadline.extend(1.0).at == 111.0
