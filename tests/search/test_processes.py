"""Work for several processes."""

from __future__ import annotations

import pytest

from brachis.errors import BrachisError
from brachis.search.processes import run_in_processes


class Unsendable:
    """What cannot be pickled."""

    def __reduce__(self):
        raise TypeError("cannot be sent")


def length(item, _listener):
    return len(item)


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
