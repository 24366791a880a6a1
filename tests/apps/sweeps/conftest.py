"""One small sweep of the planar arm, run once, and what others are compared with."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml

import brachis

ROOT = Path(__file__).parents[3]
CONTENT = yaml.safe_load("""
sweep: 1
fixed:
  search.effort: single
  search.guesses: numeric
  search.least_motion: false
  spline.intervals: 5
grid: {path.0.line.angle_deg: [80, 90, 90.0]}
rows:
- {path.0.line.length: 0.9, spline.degree: 3}
- {path.0.line.length: 9.0, spline.degree: 3}
- {path.0.line.length: 0.9, spline.degree: 9}
""") | {"task": str(ROOT / "examples/01_scara_line.yaml")}
"""Of the rows one is good, one is out of reach, and one has no such degree; an angle already in another row."""


ROUNDED = ["t_end_s", "worst_ratio", "path_error", "iterations", "wall_time_s"]


@pytest.fixture
def content():
    return copy.deepcopy(CONTENT)


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    return brachis.sweep(
        CONTENT, tmp_path_factory.mktemp("undisturbed") / "out", jobs=1
    )


@pytest.fixture(scope="session")
def same_as_undisturbed(undisturbed):
    """Whether a table says what the undisturbed one says; the last digits depend on how memory is aligned."""

    def same(table):
        ours, theirs = (each.drop(ROUNDED) for each in (table, undisturbed.table))
        ends, others = (
            np.array(each.column("t_end_s").to_pylist(), float)
            for each in (table, undisturbed.table)
        )
        return ours.equals(theirs) and ends == pytest.approx(
            others, rel=1e-6, nan_ok=True
        )

    return same
