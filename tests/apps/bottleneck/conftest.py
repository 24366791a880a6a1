"""Slides pushed by limited forces, and the paper's lines."""

from functools import cache
from pathlib import Path

import pytest

import brachis
from support.effort import QUICK
from support.slides import X, Y, slides

ROOT = Path(__file__).parents[3]
MASS, FORCE, LENGTH = 2.0, 50.0, 1.2


@pytest.fixture(scope="session")
def slide():
    """Plan a straight motion of two slides, the lower of which carries both masses."""

    def plan(
        axes=(X, Y), rows=("x", "y"), by=(LENGTH, 0.0), *, redundant=(), **keywords
    ):
        settings = {"gravity": [0, 0, 0], **keywords.pop("robot", {})}
        robot = slides(axes, [FORCE] * len(axes), MASS, **settings)
        spline = {"degree": 3, "intervals": 20, "rest": "velocity"}
        return brachis.plan(
            robot,
            start=[0.0] * len(axes),
            task_space=list(rows),
            path=brachis.Line(by=list(by)),
            redundant_joints=list(redundant),
            **spline | keywords,
            **QUICK,
        )

    return plan


@pytest.fixture(scope="session")
def scara():
    """Plan the paper's line at 90 degrees with one joint redundant; every plan is made once."""

    @cache
    def plan(joint):
        return brachis.plan(
            brachis.examples.scara_line,
            redundant_joints=[joint],
            **QUICK,
        )

    return plan
