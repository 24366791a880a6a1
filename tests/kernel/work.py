"""Work for the kernel, whose instructions `test_instructions` counts: a chain of seven joints at 61 points."""

import ctypes
import sys

import numpy as np

from brachis.kernel import (
    Basis,
    Branch,
    Chain,
    CurvePattern,
    Formula,
    MotionSlopes,
    PathMotion,
    Prescribed,
    ScaledQuantity,
    Spline,
    ValueGroups,
    VariableSlopes,
    differentiate,
    find_least_singular,
    find_postures,
    formula,
    library,
)

POINTS, N = 61, 7
TIMES = 5
"""How often the work is counted."""


def work() -> None:
    """Call every function of the inner loops once."""
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(N, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    chain = Chain(
        revolute=np.arange(N) != 1,
        axes=axes,
        points=rng.normal(size=(N, 3)),
        tool_position=rng.normal(size=3),
        tool_rotation=np.eye(3),
        masses=rng.uniform(1.0, 2.0, N),
        centers=rng.normal(size=(N, 3)),
        inertias=np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], (N, 1)),
        gravity=np.array([0.0, 0.0, -9.81]),
        friction=rng.uniform(0.1, 1.0, (N, 4)),
    )
    q, qdot, qddot = rng.normal(size=(3, POINTS, N))
    chain.torques(q, qdot, qddot)
    partials = chain.torque_derivatives(q, qdot, qddot)
    asked = Prescribed((0, 1, 2), 3, in_tool_axes=True)
    names = ("xi", "xi_ds", "xi_dds", "ydot", "yddot")
    sizes = (6, 6, 6, 2, 2)
    given = {
        name: rng.normal(size=(POINTS, size))
        for name, size in zip(names, sizes, strict=True)
    }
    given["rows"] = np.eye(N, N + 1)[[0]]
    given["y"] = rng.normal(size=(POINTS, 2))
    every = np.arange(N)
    torque = ScaledQuantity("torque", every, np.zeros(N), np.ones(N), chain)
    groups = ValueGroups([torque, None], [N, N])
    motion = PathMotion.prepare(chain, asked, given)
    motion.q[:] = q
    motion.evaluate()
    motion.derivatives()
    motion.singular_slopes(*find_least_singular(motion.inverse))
    for quantity in ("speed", "angular speed", "acceleration"):
        chain.tool_size_slopes(quantity, q, qdot, qddot)
    groups.values((q, qdot, qddot), q)
    slopes = MotionSlopes(motion.gradient, *motion.derivatives())
    places = np.arange(POINTS)
    of_curves = CurvePattern(places, places % 2, POINTS, 2)
    shared = np.ones((2, 3, POINTS, 2))
    variables = VariableSlopes(shared, of_curves, np.ones((3, POINTS)))
    states = (q, qdot, qddot)
    differentiate(groups, slopes, states, [((*partials, None), None)], variables)
    positions, rotations, _ = chain.tool(q, in_tool_axes=True)
    targets = np.concatenate([positions, rotations.reshape(POINTS, 9)], axis=1)
    find_postures(
        chain,
        asked,
        targets,
        q + 0.01,
        (np.eye(N)[[0]], q[:, :1]),
        beside=False,
    )
    mask = np.ones(N)
    branch = Branch(every[:1], every[1:], mask, mask, q[0], alternatives=8)
    turned = given | {"targets": targets, "t": np.linspace(0.0, 1.0, POINTS)}
    motion = PathMotion.prepare(chain, asked, turned, branch=branch)
    motion.answers[:] = q[:, None, 1:] + rng.normal(size=(8, N - 1))
    motion.evaluate()
    aside = np.zeros((POINTS, N))
    reference = np.column_stack([q + 0.01, q[:, 0], aside])
    along = np.column_stack([places, q[:, 0]])
    charted = given | {"targets": targets, "reference": reference, "y": along}
    PathMotion.prepare(chain, asked, charted).find_postures()
    spline = Spline.through(np.linspace(0.0, 1.0, POINTS), q)
    spline(np.linspace(0.0, 1.0, POINTS), nu=1)
    basis = Basis(rng.normal(size=(4, POINTS, 4)), places % 10)
    basis.sum(rng.normal(size=(2, 14)))
    Formula.of(lambda a: formula.sqrt(a * a + 1.0) / formula.cos(a), N)(q)


if __name__ == "__main__":
    baseline = library.library_path("baseline")
    library.library_path = lambda _variant: baseline  # what all machines have
    marks = ctypes.CDLL(sys.argv[1])
    work()
    marks.begin()
    for _ in range(TIMES):
        work()
    marks.end()
