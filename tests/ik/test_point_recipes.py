"""Every recipe for the three joints beside a spherical wrist, forwards, backwards and with joints in between."""

from __future__ import annotations

import numpy as np
import pytest

from support.factored_bench import Bench
from support.screw_arms import BASES, extra, screw_robot, wrist


def alternatives(name):
    """How many answers the three joints have: one where a step has nothing that turns."""
    if "|" not in name:
        return 4
    alone, both = sorted(name.split("|"), key=len)
    return (2 if alone == "R" else 1) * (2 if "R" in both else 1)


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("arrangement", ["alone", "backwards", "carried"])
def test_every_recipe(name, arrangement):
    rng = np.random.default_rng(len(name))
    axes, redundant = [*BASES[name], *wrist(rng)], ()
    if arrangement == "backwards":
        axes.reverse()
    elif arrangement == "carried":  # redundant joints before, within and behind the six
        axes, redundant = (
            [extra(rng, "R"), *axes[:3], extra(rng, "P"), *axes[3:], extra(rng, "R")],
            (0, 4, 8),
        )
    bench = Bench(screw_robot(axes), redundant).check()
    assert len(bench.solver.branches) == 2 * alternatives(name)
    assert len(set(bench.solver.branches)) == len(bench.solver.branches)
