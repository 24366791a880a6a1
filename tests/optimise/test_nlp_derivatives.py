"""The whole Jacobian of a program with every kind of limit, against central differences, and its sparsity pattern."""

import numpy as np
import pytest

from brachis import limits
from brachis.optimise.program import Program
from support.jacobians import comparable_rows, dense, differences
from support.phases import CASES, PHASE_KINDS, phase_of, reachable_points

KINDS = [*PHASE_KINDS, "branch_margin"]
UNTIMED = ("position", "branch_margin")


def blocks(program):
    """Rows of every kind of limit in a program of one phase; means come last."""
    (phase,) = program.phases
    result = {limit.kind: program.rows_of(limit).ravel() for limit in phase.limits}
    progress = sum(rows.size for rows in phase.value_rows)
    lengths = progress + phase.splines[0].free - 1
    result["progress"] = np.arange(progress, lengths)
    if len(phase.grid.total):
        result["lengths"] = np.arange(lengths, len(phase.lower))
    return result


UNIFORM = [(case, degree, "uniform") for case in CASES for degree in (3, 4, 5)]
FREE = [
    (case, degree, "free") for case in ("r0", "r1", "r2") for degree in (2, 3, 4, 5)
]


@pytest.fixture(params=[*UNIFORM, *FREE], ids=str, scope="module")
def program(request):
    case, degree, knots = request.param
    fixed = phase_of(case, degree=degree, rest="velocity" if degree == 2 else "full")
    return Program([fixed if knots == "uniform" else fixed.with_free_knots(0.1)])


@pytest.fixture(scope="module")
def points_and_differences(program):
    """Some points, and the Jacobian there by differences."""
    return [
        (x, differences(program, x)) for x in reachable_points(program.phases[0], 2)
    ]


def test_jacobian_equals_differences(program, points_and_differences):
    (phase,) = program.phases
    parts = blocks(program)
    kinds = [
        kind
        for kind in KINDS
        if phase.degree > 2 or kind not in ("jerk", "torque_rate")
    ]
    assert list(parts) == [
        *kinds,
        "progress",
        *(["lengths"] if len(phase.grid.total) else []),
    ]
    assert sorted(np.concatenate(list(parts.values()))) == list(
        range(len(program.lower))
    )
    for x, expected in points_and_differences:
        exact = dense(program, x)
        kept = {limit.kind: comparable_rows(phase, limit, x) for limit in phase.limits}
        for kind, rows in parts.items():
            assert np.count_nonzero(exact[rows]) > 0, f"{kind} has no entries"
            scale = np.abs(expected[rows]).max()
            wrong = np.abs(exact[rows] - expected[rows]).max(axis=1)
            if kind in kept:
                assert np.mean(kept[kind]) > 0.25
                wrong = wrong[kept[kind]]
            error = wrong.max() / scale
            assert error <= 1e-6, f"{kind}: relative error {error:.1e}"
            # Every kind but positions and margins sees the end time.
            timed = kind in limits.LIMIT_BUILDERS and kind not in UNTIMED
            assert bool(np.abs(exact[rows, 0]).max() > 1e-3) == timed


def test_the_pattern_covers_all_differences(program, points_and_differences):
    (phase,) = program.phases
    pattern = np.zeros((len(program.lower), program.variables), dtype=bool)
    pattern[program.jacobian_rows, program.jacobian_columns] = True
    for _, expected in points_and_differences:
        wrong = np.abs(expected) > 1e-7
        assert not np.any(wrong & ~pattern)
    # Each row touches the end time, at most degree + 1 control points of every curve, and free lengths nearby; the
    # last row of free knots is the sum of them, and a mean touches all.
    own = len(phase.lower)
    sizes = np.bincount(program.jacobian_rows)
    assert len(sizes) > own
    assert np.all(sizes[own:] == program.variables)
    widest = sizes[: own - len(phase.grid.total)].max()
    nearby = min(len(phase.grid.lower), 2 * phase.degree - 1)
    assert widest <= 1 + (phase.degree + 1) * (1 + phase.joint_map.r) + nearby


def test_one_sided_ranges_are_gaps_in_the_joints_own_unit():
    phase = phase_of("r1", position={"j1": [None, 2.9], "j2": [-3.0, None], "j3": None})
    (limit,) = (limit for limit in phase.limits if limit.kind == "position")
    assert [label.subject for label in limit.labels] == ["j1", "j2"]
    (x,) = reachable_points(phase_of("r1"), 1)
    state = phase.state(x)
    values = limit.values(state)
    q1, q2, _ = state.q.T
    np.testing.assert_allclose(limit.upper[0] - values[:, 0], 2.9 - q1, atol=1e-14)
    np.testing.assert_allclose(values[:, 1] - limit.lower[1], q2 + 3.0, atol=1e-14)
    assert limit.lower[0] == -limit.upper[1] == -np.inf
