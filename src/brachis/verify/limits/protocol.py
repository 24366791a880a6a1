"""What the check of a kind of limit takes and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from brachis.robot import Robot
from brachis.task import Task
from brachis.verify.motion import Pieces, States


@dataclass(frozen=True, eq=False)
class Given:
    """What is checked.

    Attributes
    ----------
    robot : Robot
    task : Task
    pieces : Pieces
    states : States
        The motion wherever it is looked at.
    """

    robot: Robot
    task: Task
    pieces: Pieces
    states: States


class Worst(NamedTuple):
    """Where a limit is used most.

    Attributes
    ----------
    ratio : float
        To the limit.
    subject : str
        Of what: a joint, the tool, ...
    time : float
        s.
    remark : str
        What there is to know of the check; empty where there is nothing.
    """

    ratio: float
    subject: str
    time: float
    remark: str = ""


LimitCheck = Callable[[Given], Worst | None]
"""Finds the worst ratio to a kind of limit; None where there is no such limit."""
