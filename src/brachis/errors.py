"""Errors that brachis raises: one base class, and subclasses that carry data.

The tree of errors::

    BrachisError                    exit code 1
    |-- PlanningError               the input was sound, but no plan could be made
    |-- ClusterError                a cluster cannot be reached, was lost, or cannot run plans
    |-- NotBuiltError               the compiled kernel is missing or damaged
    |-- UnreachableError            a trial point of the optimiser is outside the branch
    `-- InputError                  the input is wrong; exit code 2
        |-- TaskError               a task file or task mapping
        |-- UrdfError               a URDF file
        |-- ResultFileError         a saved result
        |-- UnknownNameError        a name that does not exist
        |-- LimitError              a limit that is missing or unusable
        |-- PathError               the prescribed path
        |-- StartError              the start or end posture
        |-- DecompositionError      a choice of redundant joints without a closed form
        |-- PlausibilityError       implausible figures that are treated as errors
        `-- NotInstalledError       a missing library of an optional extra
    MissingAttributeError           an AttributeError that suggests an attribute
    BrachisWarning                  a UserWarning

Every message says what is wrong and where, what was found, what is allowed, and what to try; attributes hold the same
facts. ``exit_code`` is that of the command line: 2 for wrong input, 1 if no plan could be made.

Examples
--------
>>> import brachis
>>> brachis.errors.nearest("spine", ["spline", "solver"])
'spline'
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Self, TypedDict, Unpack

PIP = "python -m pip install"


@dataclass(frozen=True)
class Remedy:
    """A number in the task that may be changed to make a plan possible.

    Attributes
    ----------
    key : str
        Dotted key, for example ``boundary.end_speed``.
    current : float
        The value in the task.
    guess : float
        A value that may make a plan possible.
    unit : str
    is_known : bool
        Whether it is known that no smaller change than the guess can be enough.
    """

    key: str
    current: float
    guess: float
    unit: str = ""
    is_known: bool = False

    @property
    def verb(self) -> str:
        """What to do with the number: ``lower`` or ``raise``."""
        return "lower" if self.guess < self.current else "raise"


_NAMES_HERE = {
    name: tuple(here.split())
    for names, here in {
        "duration end_time total_time": "t_end",
        "success ok valid feasible": "verified",
        "t ts time timestamps": "t times",
        "positions joint_positions qs pos": "q position",
        "velocities qd dq qs_dot": "qdot velocity",
        "accelerations qdd ddq": "qddot acceleration",
        "tau torques": "tau torque",
        "eval evaluate interpolate value": "at",
        "dof ndof nq nv num_joints": "n",
        "fk forward_kinematics tool_pose": "tool_placement",
        "show animate display visualize": "view",
        "to_csv to_file write dump export": "brachis.export.write",
        "q0 q_start initial start_joints start_posture start_state": "start",
        "goal target q_goal q_end goal_state stop finish": "end to",
        "waypoints points": "path through",
        "timeout max_time": "time_limit",
        "verbose callback": "progress",
        "workers n_jobs num_workers processes threads": "jobs",
        "gridpoints n_intervals segments": "intervals",
        "optimize optimise solve generate compute_trajectory": "plan",
        "load read open": "load_task",
        "load_robot load_urdf from_urdf model": "Robot",
        "version": "__version__",
        "end": "to",
    }.items()
    for name in names.split()
}
"""Names in other libraries, with the names that brachis uses; the first of those that exists is suggested."""


class Details(TypedDict, total=False):
    """The facts that an error states in addition to the problem; see `BrachisError`."""

    found: object
    allowed: object
    where: str | None
    hint: str | None


class BrachisError(Exception):
    """Base class of all errors of brachis.

    Parameters
    ----------
    problem : str
        What is wrong, in a few words.
    found : object, optional
        What was found.
    allowed : object, optional
        The values that would have been accepted.
    where : str, optional
        Place of the problem: file and key, joint, or interval of the path coordinate.
    hint : str, optional
        What to try.

    Attributes
    ----------
    remedies : tuple of Remedy
        Numbers in the task to change. `brachis.plan` tests new values, and the hint names those that lead to a plan.

    Examples
    --------
    >>> import brachis
    >>> try:
    ...     brachis.load_task({"brachis": 2})
    ... except brachis.BrachisError as error:
    ...     print(error.exit_code)
    2
    """

    exit_code = 1
    remedies: tuple[Remedy, ...] = ()

    def __init__(
        self,
        problem: str,
        *,
        found: object = None,
        allowed: object = None,
        where: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem = problem
        self.found = found
        self.allowed = allowed
        self.where = where
        self.hint = hint
        super().__init__(problem)

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling with all data, whatever arguments the constructor of a subclass has."""
        return type(self).__new__, (type(self), *self.args), self.__dict__

    def with_remedies(self, *remedies: Remedy) -> Self:
        """Attach numbers in the task that could be changed, and return the error."""
        self.remedies = remedies
        return self

    def put_advice(self, advice: str) -> None:
        """Put advice before the hint."""
        if self.hint:
            advice += f", or {self.hint[:1].lower()}{self.hint[1:]}"
        self.hint = advice

    def __str__(self) -> str:
        """Return the message."""
        text = f"{self.where}: {self.problem}" if self.where else self.problem
        if self.found is not None:
            text += f"; found {self.found}"
        if self.allowed is not None:
            text += f"; allowed: {self.allowed}"
        if self.hint:
            text += f". {self.hint}"
        return text

    def __repr__(self) -> str:
        """Return the type and the message."""
        return f"{type(self).__name__}({str(self)!r})"


class BrachisWarning(UserWarning):
    """A warning about something that is allowed, but that the user should know about."""


class InputError(BrachisError):
    """The input is wrong: a file, a key, a value.

    Examples
    --------
    >>> import brachis
    >>> try:
    ...     brachis.robots.path_of("scara4")
    ... except brachis.InputError as error:
    ...     print(error.valid[-3:])
    ('tx90l_positioner', 'tx90l_rail', 'ur10_rail')
    """

    exit_code = 2


class TaskError(InputError):
    """A task file or task mapping is wrong; ``where`` names the file and the key."""


class UrdfError(InputError):
    """A URDF file is missing, broken, or describes a robot that brachis cannot plan for."""


_NOT_STRICT = (
    "If these figures are intended, turn the error into warnings with strict: false in the task file, "
    "brachis.plan(..., strict=False), or brachis plan --no-strict"
)


class PlausibilityError(InputError):
    """Figures are implausible, and are treated as errors.

    Attributes
    ----------
    remarks : tuple of str
        One line for each implausible figure.
    """

    def __init__(self, remarks: Sequence[str]) -> None:
        self.remarks = tuple(remarks)
        lines = "\n  ".join(("not plausible:", *self.remarks))
        super().__init__(lines, hint=_NOT_STRICT)


class UnknownNameError(InputError):
    """A name (joint, frame, solver, branch, ...) does not exist.

    Attributes
    ----------
    kind : str
        Kind of name that was looked up, for example ``"joint"``.
    name : str
        The unknown name, or the first of several.
    valid : tuple of str
        The names that exist.
    """

    def __init__(
        self,
        kind: str,
        name: str,
        valid: Iterable[str],
        *,
        more_names: Sequence[str] = (),
        where: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.kind = kind
        self.name = name
        self.valid = tuple(valid)
        super().__init__(
            f"there is no {kind} named {' or '.join(map(repr, (name, *more_names)))}",
            allowed=", ".join(self.valid) or "none",
            where=where,
            hint=hint or suggest(name, self.valid),
        )


def check_names(
    kind: str, names: Iterable[str], valid: Collection[str], where: str
) -> None:
    """Refuse names that do not exist; see `UnknownNameError`."""
    unknown = [name for name in names if name not in valid]
    if unknown:
        first, *more_names = unknown
        raise UnknownNameError(kind, first, valid, more_names=more_names, where=where)


class LimitError(InputError):
    """A limit is missing or unusable.

    Attributes
    ----------
    joint : str
        The joint's name.
    key : str
        The task key that supplies the limit, for example ``robot.limits.torque.j1``.
    """

    def __init__(
        self, problem: str, *, joint: str, key: str, **details: Unpack[Details]
    ) -> None:
        self.joint = joint
        self.key = key
        details["where"] = f"joint {joint!r}"
        details["hint"] = f"Set {key} in the task file"
        super().__init__(problem, **details)


class PathError(InputError):
    """The prescribed path is wrong.

    Attributes
    ----------
    s_interval : tuple of float or None
        The faulty part of the path, as an interval of the dimensionless path coordinate.
    """

    def __init__(
        self,
        problem: str,
        *,
        s_interval: tuple[float, float] | None = None,
        **details: Unpack[Details],
    ) -> None:
        self.s_interval = s_interval
        if s_interval is not None and not details.get("where"):
            details["where"] = f"path, s in [{s_interval[0]:.4g}, {s_interval[1]:.4g}]"
        super().__init__(problem, **details)


class StartError(InputError):
    """The start or end posture contradicts the limits, the path or the branch."""


class DecompositionError(InputError):
    """No closed form fits the requested choice of redundant joints.

    Attributes
    ----------
    redundant_joints : tuple of str
        The requested choice.
    reasons : dict of str to str
        For each family that was tried, the reason why it does not fit.
    available : tuple of tuple of str
        Choices of redundant joints of this robot and task space that do have a closed form.
    """

    def __init__(
        self,
        problem: str,
        *,
        redundant_joints: Sequence[str],
        reasons: dict[str, str] | None = None,
        available: Sequence[tuple[str, ...]] = (),
        **details: Unpack[Details],
    ) -> None:
        self.redundant_joints = tuple(redundant_joints)
        self.reasons = dict(reasons or {})
        self.available = tuple(available)
        if self.reasons:
            tried = (f"{family}: {why}" for family, why in self.reasons.items())
            problem += f"; tried {'; '.join(tried)}"
        details["where"] = "redundant_joints"
        if self.available:
            choices = " | ".join(f"[{', '.join(names)}]" for names in self.available)
            details["hint"] = f"Choices with a closed form: {choices}"
        super().__init__(problem, **details)


class ResultFileError(InputError):
    """A saved result is missing, broken, or has a different schema version."""


class ClusterError(BrachisError):
    """The cluster that plans were sent to cannot be reached, was lost, or cannot run them."""


class NotInstalledError(InputError):
    """A library that belongs to an optional extra of brachis is not installed.

    Attributes
    ----------
    library, extra : str
        The library, and the extra of brachis that installs it.
    """

    def __init__(self, user: str, library: str, extra: str) -> None:
        self.library = library
        self.extra = extra
        hint = f'In a clone of brachis run {PIP} ".[{extra}]"; with a wheel run {PIP} "brachis-....whl[{extra}]"'
        super().__init__(f"{user} needs {library}, which is not installed", hint=hint)


class NotBuiltError(BrachisError):
    """The compiled kernel is missing, damaged, or built from different source code."""

    def __init__(self, problem: str, script: object) -> None:
        hint = f"Run python {script}; without a C compiler, run {PIP} ziglang first"
        super().__init__(f"the kernel is not built: {problem}", hint=hint)


class UnreachableError(BrachisError):
    """A trial point of the optimiser has a collocation point outside the branch; solvers then shorten their step."""


class PlanningError(BrachisError):
    """The input was sound, yet no plan could be made; the message says what was tried.

    Examples
    --------
    >>> import brachis
    >>> issubclass(brachis.PlanningError, brachis.InputError), brachis.PlanningError("no motion").exit_code
    (False, 1)
    """


def nearest(
    name: object, valid: Iterable[str], *, is_attribute: bool = False
) -> str | None:
    """Suggest the valid name that a misspelling, a longer name, or a name from another library probably means.

    If an attribute is wanted, functions elsewhere in brachis may be suggested too.
    """
    if not isinstance(name, str):
        return None
    by_small = {candidate.lower(): candidate for candidate in valid}
    small = name.lower()
    known = [
        candidate
        for candidate in _NAMES_HERE.get(small, ())
        if candidate in by_small.values() or (is_attribute and "." in candidate)
    ]
    begun = [candidate for candidate in by_small if small.startswith(f"{candidate}_")]
    if known and small not in by_small:
        return known[0]
    near = (
        difflib.get_close_matches(small, by_small, cutoff=0.9)
        or sorted(begun, key=len, reverse=True)
        or difflib.get_close_matches(small, by_small, cutoff=0.65)
    )
    return by_small[near[0]] if near else None


def suggest(
    name: object, valid: Iterable[str], *, is_attribute: bool = False
) -> str | None:
    """Return a question that suggests the `nearest` valid name; None if no name is similar."""
    near = nearest(name, valid, is_attribute=is_attribute)
    return f"Did you mean {near!r}?" if near else None


class MissingAttributeError(AttributeError):
    """An object lacks an attribute; the message suggests another one, which may belong to a part of the object."""

    def __init__(self, instance: object, name: str) -> None:
        super().__init__()
        self._instance = instance
        self._name = name

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling without the object."""
        return AttributeError, (str(self),)

    def __str__(self) -> str:
        """Return the message; the suggestion is looked up only now, because most such errors are caught unread."""
        name = self._name
        meant = None if name.startswith("_") else _attribute_meant(self._instance, name)
        message = f"{type(self._instance).__name__!r} object has no attribute {name!r}"
        return message + (f". Did you mean {meant!r}?" if meant else "")


def _attribute_meant(instance: object, name: str) -> str | None:
    """Return the attribute of an object, or of one of its parts, that a name may mean."""
    public = [entry for entry in dir(instance) if not entry.startswith("_")]
    for word in (name, *_NAMES_HERE.get(name.lower(), ())):
        if word in public or "." in word:
            return word
        for field, value in vars(instance).items():
            known = hasattr(type(value), word) or word in getattr(value, "__dict__", ())
            if field in public and known:
                return f"{field}.{word}"
    return nearest(name, public, is_attribute=True)


def no_attribute(
    module: str, kind: str, name: str, valid: Sequence[str]
) -> AttributeError:
    """Return the error for an unknown name in a module whose attributes are all of one kind, such as robots."""
    hint = suggest(name, valid)
    return AttributeError(
        f"module {module!r} has no attribute {name!r}; {kind}: {', '.join(valid)}"
        + (f". {hint}" if hint else "")
    )


def __dir__() -> list[str]:
    """List the names for completion."""
    homes = {key: getattr(value, "__module__", "") for key, value in globals().items()}
    return [key for key, home in homes.items() if home == __name__ and key[0] != "_"]
