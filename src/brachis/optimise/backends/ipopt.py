"""IPOPT, an interior-point method, through the ipyopt wheel. It solves large programs, and others if Uno fails.

The Hessian is IPOPT's limited-memory approximation or, with the option `damping`, the known part of the program's
Hessian. https://coin-or.github.io/Ipopt
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.backends.monitor import Function, SolveMonitor, objective_at
from brachis.optimise.backends.protocol import Curvature, SolverReport, SolveStatus

NAME = "ipopt"
Hessian = Callable[[np.ndarray, np.ndarray, float, np.ndarray], None]
"""Function that writes entries of a Hessian at a point, with multipliers of the rows and of the objective."""
_RESTORATION = 1
"""IPOPT's mode in which it ignores the objective and looks for a feasible point."""
_OPTIONS: dict[str, int | float | str] = {
    "print_level": 0,
    "sb": "yes",
    # Including the approximation in the linear system takes half as long as correcting the solution afterwards.
    "limited_memory_aug_solver": "extended",
    "mu_strategy": "adaptive",
    # Bang-bang motions change in large steps, which a filter refuses. With a filter, programs of seven phases were up
    # to 5 % slower after 200 iterations.
    "adaptive_mu_globalization": "kkt-error",
    # With a larger barrier, thousands of rows drive the first iterates to motions ten times as slow.
    "mu_max": 1e-3,
    "bound_relax_factor": 0.0,
}
"""Options of IPOPT for every program."""
_MINIMUM_DEGREE = 0
_AUTOMATIC = 7
"""Orders of the linear solver's pivots."""
_MANY_ENTRIES = 100_000
"""Number of entries of the Jacobian above which pivots are ordered by approximate minimum degree. With 229,000, a solve
took 2.0 s in place of 3.1 s. With up to 60,000, ten plans at a given speed took 150 s in place of 110 s."""
_PUSH = 1e-2
"""Distance from bounds to which IPOPT pushes a starting point, relative to their size. This is its default."""
_PUSHES = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")
_STATUS = {
    0: SolveStatus.OPTIMAL,
    1: SolveStatus.ACCEPTABLE,
    2: SolveStatus.INFEASIBLE,
    3: SolveStatus.ACCEPTABLE,  # search direction too small: judged by its residuals
    -1: SolveStatus.ITERATION_LIMIT,
    -4: SolveStatus.TIME_LIMIT,
    -5: SolveStatus.TIME_LIMIT,
    -13: SolveStatus.EVALUATION_ERROR,
}


def run(monitor: SolveMonitor, x: np.ndarray) -> SolverReport:
    """Solve the monitor's program from `x`."""
    import ipyopt

    program = monitor.program
    options = monitor.options

    def or_nan(
        function: Function, at_stop: float = np.nan
    ) -> Callable[[np.ndarray, np.ndarray], None]:
        """Wrap a function: write NaN where the function has no value, and `at_stop` once the solve has to stop."""

        def write(point: np.ndarray, out: np.ndarray) -> None:
            """Write the values at a point."""
            try:
                out[:] = function(point)
            except UnreachableError:
                # When it gets NaN, IPOPT shortens the step.
                out[:] = at_stop if monitor.must_stop() else np.nan

        return write

    iterate = x

    def differentiate(point: np.ndarray) -> np.ndarray:
        """Return the Jacobian at a point. IPOPT asks for it only at iterates."""
        nonlocal iterate
        iterate = point.copy()
        return monitor.jacobian(point)

    def intermediate(
        mode: int,
        _iteration: int,
        objective: float,
        infeasibility: float,
        _dual_infeasibility: float,
        barrier: float,
        *_: float,
    ) -> bool:
        """Tell whether IPOPT may continue after an iteration."""
        monitor.keep(iterate, objective, infeasibility)
        # Iterates of a restoration do not show whether the solve has settled.
        gap = np.inf if mode == _RESTORATION else barrier
        return not monitor.ends_interior(objective, infeasibility, gap)

    def clip(bounds: np.ndarray) -> np.ndarray:
        """Convert infinite bounds to IPOPT's form."""
        return np.clip(bounds, -2e19, 2e19)  # IPOPT treats 1e19 as infinity

    is_large = len(program.jacobian_rows) > _MANY_ENTRIES
    known = program.curvature(x) if options.damping else None
    entries, hessian = _damp(known, options.damping, x)
    backend = ipyopt.Problem(
        len(x),
        clip(program.x_lower),
        clip(program.x_upper),
        len(program.lower),
        clip(program.lower),
        clip(program.upper),
        (program.jacobian_rows, program.jacobian_columns),
        entries,
        lambda point: objective_at(program, point, np.nan),
        or_nan(monitor.gradient),
        or_nan(monitor.rows),
        or_nan(differentiate, 0.0),  # NaN at the first point ends the process
        intermediate_callback=intermediate,
        eval_h=hessian,
        ipopt_options={
            **_OPTIONS,
            "hessian_approximation": "limited-memory" if known is None else "exact",
            "mumps_pivot_order": _MINIMUM_DEGREE if is_large else _AUTOMATIC,
            **dict.fromkeys(_PUSHES, _PUSH * options.first_step),
            "tol": options.tolerance,
            "constr_viol_tol": options.tolerance,
            "max_iter": options.max_iterations,
        },
    )
    multipliers = np.zeros(len(program.lower))
    with monitor:
        answer, _, code = backend.solve(x.copy(), mult_g=multipliers)
    status = _STATUS.get(int(code), SolveStatus.FAILED)
    message = f"return code {code}"
    return monitor.report(NAME, status, np.array(answer), -multipliers, message)


def _damp(
    known: Curvature | None, damping: float, x: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], Hessian | None]:
    """Return the places of the known part of a Hessian, and a function that writes it, damped along its diagonal.

    Places where it is zero at the start x, (v,), are left out. The Hessian is only an approximation.
    """
    nothing = np.array([], dtype=int)
    if known is None:
        return (nothing, nothing), None
    at_start = known.hessian(x, 1.0, known.multipliers)
    rows, columns = np.nonzero(np.tril(at_start) + np.eye(len(x)))

    def write(
        point: np.ndarray, multipliers: np.ndarray, factor: float, out: np.ndarray
    ) -> None:
        """Write the entries at a point."""
        hessian = known.hessian(point, factor, -multipliers)
        added = damping * np.median(hessian.diagonal())
        out[:] = hessian[rows, columns] + added * (rows == columns)

    return (rows, columns), write
