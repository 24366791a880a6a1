"""Plans handed out to an executor, and what comes back."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait

from brachis import interrupts
from brachis.errors import BrachisError, ClusterError
from brachis.sweeps.plans import Plan
from brachis.sweeps.worker import Outcome

Submit = Callable[[Plan], "Future[Outcome]"]
AHEAD = 2
"""Plans that are handed out for each process, so that none waits for the next one."""
HEARTBEAT = 1.0
"""Seconds after which Ctrl-C, or a parent that was killed, is noticed at the latest."""
_ENDED = "the plan ended its worker process each time: a crash, or too little memory"


def as_completed(
    plans: Iterable[Plan], submit: Submit, width: Callable[[], int], lost: tuple[type[Exception], ...] = ()
) -> Iterator[tuple[Plan, Outcome]]:
    """Hand out plans to an executor, a few more than it has workers, and yield what comes back.

    Parameters
    ----------
    plans : iterable of Plan
    submit : callable
    width : callable
        How many plans may be under way.
    lost : tuple of exception types
        With which the executor says that a plan ended its worker time and again.
    """
    waiting, suspects, tested = iter(plans), deque[Plan](), None
    running: dict[Future[Outcome], Plan] = {}
    while True:
        if not suspects:
            taken = list(itertools.islice(waiting, max(0, width() - len(running))))
        else:
            taken = [] if running else [suspects.popleft()]
            tested = taken[0] if taken else tested
        running |= {submit(plan): plan for plan in taken}
        if not running:
            return
        done, _ = wait(running, HEARTBEAT, FIRST_COMPLETED)
        interrupts.check()
        for future in done:
            plan = running.pop(future)
            try:
                outcome = future.result()
            except BrokenExecutor as error:
                if plan is not tested:
                    suspects.append(plan)
                    continue
                outcome = Outcome.of_error(error, message=_ENDED)
            except lost as error:
                outcome = Outcome.of_error(error, message=_ENDED)
            except (BrachisError, CancelledError):  # of the connection, in whose words the caller speaks
                raise
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
                raise ClusterError("plans cannot be made there", found=found) from error
            yield plan, outcome
