"""Figures that are hardly meant, as warnings or errors."""

from __future__ import annotations

import warnings
from dataclasses import asdict, dataclass

from brachis.errors import BrachisWarning, PlausibilityError


class PlausibilityWarning(BrachisWarning):
    """A figure of the robot, the task or the motion is hardly meant.

    Examples
    --------
    >>> import brachis
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     fast = {"velocity": 180.0}  # degrees per second
    ...     result = brachis.plan(brachis.examples.scara_line, limits=fast, redundant_joints=["j1"], intervals=8)
    >>> caught[0].category.__name__
    'PlausibilityWarning'
    """


@dataclass(frozen=True)
class Remark:
    """A figure that is allowed and hardly meant.

    Attributes
    ----------
    where : str
        Task key, or joint or link of the robot.
    message : str
        What it looks like.
    found : str
        The figure with its unit.
    usual : str
        What such figures usually are.
    """

    where: str
    message: str
    found: str
    usual: str

    def __str__(self) -> str:
        """Say it in one line."""
        return f"{self.where}: {self.message}; found {self.found}; usual: {self.usual}"

    def to_dict(self) -> dict[str, str]:
        """Return plain data for JSON."""
        return asdict(self)


def _together(remarks: tuple[Remark, ...]) -> tuple[Remark, ...]:
    """Make one remark of those that say the same of several joints."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.where.rpartition(".")[0], remark.message), []).append(remark)
    return tuple(group[0] if len(group) == 1 else _of_all(stem, group) for (stem, _), group in groups.items())


def _of_all(stem: str, group: list[Remark]) -> Remark:
    """Make one remark of several below a key."""
    found = ", ".join(f"{remark.where.removeprefix(f'{stem}.')} {remark.found}" for remark in group)
    return Remark(stem, group[0].message, found, "; ".join(dict.fromkeys(remark.usual for remark in group)))


def tell(remarks: tuple[Remark, ...], *, strict: bool | None, stacklevel: int = 2) -> tuple[Remark, ...]:
    """Warn of remarks, or refuse some or all of them; return them, one for all joints of which they say the same.

    Parameters
    ----------
    remarks : tuple of Remark
    strict : bool or None
        Whether they are errors; None: those of the start posture are.
    stacklevel : int, optional
        As of `warnings.warn`; 2 blames the caller.

    Raises
    ------
    PlausibilityError
    """
    remarks = _together(remarks)
    refused = [str(each) for each in remarks if strict or (strict is None and each.where.startswith("start.joints"))]
    if refused:
        raise PlausibilityError(refused)
    for remark in remarks:
        warnings.warn(str(remark), PlausibilityWarning, stacklevel=stacklevel)
    return remarks
