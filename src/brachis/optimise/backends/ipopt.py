"""IPOPT, an interior-point method, through the ipyopt wheel. It solves large programs, and others if Uno fails.

The Hessian is IPOPT's limited-memory approximation. https://coin-or.github.io/Ipopt
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.backends.monitor import Function, SolveMonitor, objective_at
from brachis.optimise.backends.protocol import SolverReport, SolveStatus

NAME = "ipopt"
_RESTORATION = 1
"""IPOPT's mode in which it ignores the objective and looks for a feasible point."""
_OPTIONS: dict[str, int | float | str] = {
    "print_level": 0,
    "sb": "yes",
    "hessian_approximation": "limited-memory",
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

    nothing = np.array([], dtype=int)
    backend = ipyopt.Problem(
        len(x),
        clip(program.x_lower),
        clip(program.x_upper),
        len(program.lower),
        clip(program.lower),
        clip(program.upper),
        (program.jacobian_rows, program.jacobian_columns),
        (nothing, nothing),
        lambda point: objective_at(program, point, np.nan),
        or_nan(monitor.gradient),
        or_nan(monitor.rows),
        or_nan(differentiate, 0.0),  # NaN at the first point ends the process
        intermediate_callback=intermediate,
        ipopt_options={
            **_OPTIONS,
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
