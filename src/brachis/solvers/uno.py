"""Uno (Vanaret and Leyffer): an active-set SQP with a filter and a trust region, the default.

Bang-bang optima are vertices of the feasible set, which an active-set method reaches in a few steps. The Hessian is
Uno's limited-memory approximation, the subproblem solver its BQPD. https://github.com/cvanaret/Uno
"""

from __future__ import annotations

import io

import numpy as np

from brachis.solvers.protocol import Problem, Progress, SolverOptions, SolverReport, SolveStatus
from brachis.solvers.watch import Watch

name = "uno"

_TRUST_RADIUS = 1.0
"""Uno's own 10 lets the first step wreck its Hessian approximation: steps then stay tiny for hundreds of iterations
(seen on 1 of 8 random lines of the planar arm, on none with 1)."""
_STATUS = {
    "FEASIBLE_KKT_POINT": SolveStatus.OPTIMAL,
    "FEASIBLE_FJ_POINT": SolveStatus.ACCEPTABLE,
    "FEASIBLE_SMALL_STEP": SolveStatus.ACCEPTABLE,
    "INFEASIBLE_STATIONARY_POINT": SolveStatus.INFEASIBLE,
    "INFEASIBLE_SMALL_STEP": SolveStatus.INFEASIBLE,
}
_STOPPED = {
    "ITERATION_LIMIT": SolveStatus.ITERATION_LIMIT,
    "TIME_LIMIT": SolveStatus.TIME_LIMIT,
    "EVALUATION_ERROR": SolveStatus.EVALUATION_ERROR,
}


def solve(problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None) -> SolverReport:
    """See `brachis.solvers.protocol.Solver`."""
    import unopy  # noqa: PLC0415  (a solver is imported when it is used)

    watch = Watch(problem, options, progress)
    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR, len(x), problem.x_lower.tolist(), problem.x_upper.tolist(), unopy.ZERO_BASED_INDEXING
    )
    gradient = problem.gradient()

    def objective_gradient(_x: np.ndarray, out: np.ndarray) -> None:
        out[:] = gradient

    def rows(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.rows(point)

    def jacobian(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.jacobian(point)

    model.set_objective(unopy.MINIMIZE, problem.objective, objective_gradient)
    model.set_constraints(
        len(problem.lower),
        rows,
        problem.lower.tolist(),
        problem.upper.tolist(),
        len(problem.jacobian_rows),
        problem.jacobian_rows.tolist(),
        problem.jacobian_columns.tolist(),
        jacobian,
    )
    model.set_initial_primal_iterate(x.tolist())
    backend = unopy.UnoSolver()
    backend.set_preset("filtersqp")
    backend.set_logger_stream(io.StringIO())  # Uno would print to standard output
    backend.set_option("logger", "SILENT")
    backend.set_option("print_solution", False)  # noqa: FBT003
    backend.set_option("primal_tolerance", options.tolerance)
    backend.set_option("dual_tolerance", options.tolerance)
    backend.set_option("TR_radius", _TRUST_RADIUS)
    backend.set_option("max_iterations", options.max_iterations)
    backend.set_option("time_limit", float(options.time_limit))
    backend.set_termination_callback(lambda point, *_: watch.between_iterations(float(point[0])))
    result = backend.optimize(model)
    answer = np.array(result.primal_solution)
    ending = result.optimization_status.name
    status = _STOPPED.get(ending) or _STATUS.get(result.solution_status.name, SolveStatus.FAILED)
    message = f"{ending.lower()}, {result.solution_status.name.lower()}"
    return watch.report(name, status, answer, np.array(result.constraint_dual_solution), message)
