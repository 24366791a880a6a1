"""What is said of closed forms that a robot lacks."""

from __future__ import annotations

from collections.abc import Sequence

from brachis.ik.eaik import NOT_INSTALLED, eaik
from brachis.ik.registry import Candidate

NO_CLOSED_FORM = (
    "no choice of redundant joints has a closed form: motions are planned from differential inverse kinematics"
)
"""Of a robot and a task space without any."""
_INSTALLING = "installing it takes a C++ compiler except on macOS and on Linux for x86_64 with Python 3.13 or older"
"""What installing EAIK may ask for; where it has wheels it comes with brachis."""


def missing_eaik(candidates: Sequence[Candidate]) -> str:
    """Say which choices of redundant joints EAIK might add, and how to get it.

    Parameters
    ----------
    candidates : sequence of Candidate
        All choices, as `find_all` returns them.

    Returns
    -------
    str
        A sentence without its full stop; empty where EAIK is installed or would add nothing.
    """
    further = [
        candidate.redundant_joints
        for candidate in candidates
        if candidate.solver is None and candidate.reasons.get(eaik.name) == NOT_INSTALLED
    ]
    if not further:
        return ""
    names = ", ".join("[" + ", ".join(joints) + "]" for joints in further)
    return f"{NOT_INSTALLED}; it might add the redundant joints {names}; {_INSTALLING}"
