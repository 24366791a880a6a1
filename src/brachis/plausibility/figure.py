"""A figure beside what such figures usually are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from brachis.plausibility.remark import Remark


@dataclass(frozen=True)
class Figure:
    """A figure, and the largest one that is usual.

    Attributes
    ----------
    where : str
        Task key, or joint or link of the robot.
    message : str
        What it looks like where it is larger.
    value, usual : float
        In `unit`; a NaN is never remarked upon.
    unit : str
    aside : str
        What is said behind what is usual: for what, or what else to write.
    shown : str
        The figure in words, where it is more than one number.
    """

    where: str
    message: str
    value: float
    usual: float
    unit: str
    aside: str = ""
    shown: str = ""


def remarks(figures: Iterable[Figure]) -> Iterator[Remark]:
    """Remark upon the figures that are larger than usual."""
    for figure in figures:
        if figure.value > figure.usual:
            found = figure.shown or f"{figure.value:.6g}"
            usual = f"below {figure.usual:.3g} {figure.unit}{figure.aside}"
            yield Remark(figure.where, figure.message, f"{found} {figure.unit}", usual)
