"""Work for several processes."""

from __future__ import annotations

import pytest

from brachis.errors import BrachisError
from brachis.search import processes
from brachis.search.processes import run_in_processes


class Unsendable:
    """What cannot be pickled."""

    def __reduce__(self):
        raise TypeError("cannot be sent")


def length(item, _listener):
    return len(item)


def say(item, listener):
    listener(str(item))
    return item


def test_work_that_cannot_be_sent_is_said_so():
    assert list(run_in_processes(length, ["a", "bc"], jobs=2, listener=print)) == [1, 2]
    with pytest.raises(
        BrachisError, match=r"the worker processes cannot run the plans; .*jobs: 1"
    ):
        list(
            run_in_processes(
                length, [Unsendable(), Unsendable()], jobs=2, listener=print
            )
        )


def test_auto_starts_processes_when_what_is_left_takes_long(monkeypatch):
    """The first item is done here; the rest elsewhere, where nobody hears it."""
    here = []

    def listen(text):
        here.append(text)

    assert list(run_in_processes(say, [1, 2, 3], jobs="auto", listener=listen)) == [
        1,
        2,
        3,
    ]
    assert here == ["1", "2", "3"]
    here.clear()
    monkeypatch.setattr(processes, "_PAYS", 0.0)
    assert list(run_in_processes(say, [1, 2, 3], jobs="auto", listener=listen)) == [
        1,
        2,
        3,
    ]
    assert here == ["1"]
