"""What a limit costs: the derivative of t_E with respect to every limit, from the multipliers.

Every limit lists the figures that a user could change, and the rates d at which the bounds of its rows move outwards if
one of them is relaxed (`brachis.limits.Bound`). With the multipliers w of these rows

    dt_E / d(figure) = -sum w d.

The multipliers are the solver's if they balance the gradient, otherwise those by least squares. At an optimum the
gradient of t_E is a combination of the slopes of the active rows and variable bounds,

    grad t_E = sum_i w_i p_i,    w_i >= 0,

with p_i the gradient of a row or variable at its lower bound, or minus that at its upper bound. The norm of what is
left over, relative to the gradient's, measures how far an answer is from being stationary.

If the slopes are linearly dependent, many sets of multipliers balance the gradient. The one that holds for a relaxation
is the one that promises the least (Gauvin and Tolle, SIAM J. Control Optim. 15, 1977): a linear program.

A motion that the phase plane timed has no multipliers: its joint path is timed again with every limit a little raised.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.common.summary import Summary
from brachis.limits import Bound, Label, Limit
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import Program, is_safeguard
from brachis.optimise.retiming import SOLVER

if TYPE_CHECKING:
    from scipy import sparse


def jacobian_matrix(program: Program, x: np.ndarray) -> sparse.csr_array:
    """Differentiate the rows of a program at x, (v,): a matrix, (c, v).

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    from scipy import sparse

    places = (program.jacobian_rows, program.jacobian_columns)
    shape = (len(program.lower), len(x))
    return sparse.coo_array((program.jacobian(x), places), shape=shape).tocsr()


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Rows and variables at their bounds at a point x.

    Attributes
    ----------
    slopes : (p, v) ndarray
        Gradients of active rows, then of active variables; negative ones at upper bounds.
    rows : (a,) int ndarray
        Rows to which the first a slopes belong.
    signs : (a,) ndarray
        1 at a lower bound, -1 at an upper one.
    equalities : int
        Number of rows and variables that are at both bounds, each with two slopes.
    """

    slopes: np.ndarray
    rows: np.ndarray
    signs: np.ndarray
    equalities: int = 0

    @classmethod
    def at(cls, program: Program, x: np.ndarray, near: float) -> ActiveSet:
        """Collect rows and variables that are nearer to their bounds than `near`, dimensionless, at x, (v,).

        Rows that no variable changes, such as those at a given start posture, are left out.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        values = program.rows(x)
        jacobian = jacobian_matrix(program, x)
        low = np.flatnonzero(values <= program.lower + near)
        high = np.flatnonzero(values >= program.upper - near)
        rows = np.concatenate([low, high])
        signs = np.repeat([1.0, -1.0], [len(low), len(high)])
        slopes = signs[:, None] * jacobian[rows].toarray()
        kept = slopes.any(axis=1)
        unit = np.eye(len(x))
        at_lower = x <= program.x_lower + near
        at_upper = x >= program.x_upper - near
        slopes = np.vstack([slopes[kept], unit[at_lower], -unit[at_upper]])
        rows = rows[kept]
        twice = len(rows) - len(np.unique(rows)) + int((at_lower & at_upper).sum())
        return cls(slopes, rows, signs[kept], twice)

    @cached_property
    def dependent(self) -> bool:
        """Whether several sets of multipliers may balance a gradient; those of equalities have either sign."""
        count = len(self.slopes) - self.equalities
        return bool(np.linalg.matrix_rank(self.slopes, tol=1e-9) < count)

    def weights_of(
        self, gradient: np.ndarray, multipliers: np.ndarray | None
    ) -> np.ndarray:
        """Weights, (p,), from a solver's multipliers of all rows, (c,); those of variables balance what they can.

        Without multipliers, the weights that balance the gradient best: non-negative least squares (Lawson and Hanson).
        """
        if multipliers is not None:
            of_rows = np.maximum(self.signs * multipliers[self.rows], 0.0)
            rest = gradient - of_rows @ self.slopes[: len(of_rows)]
            of_variables = np.maximum(self.slopes[len(of_rows) :] @ rest, 0.0)
            return np.concatenate([of_rows, of_variables])
        from scipy.optimize import nnls

        if not len(self.slopes):
            return np.empty(0)
        return np.asarray(nnls(self.slopes.T, gradient)[0])


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers at an answer, and how well they balance the gradient.

    Attributes
    ----------
    active_set : ActiveSet
    weights : (p,) ndarray
        Multipliers of the active_set, >= 0; s for a row, whose values are dimensionless.
    source : str
        ``"solver"`` or ``"least squares"``.
    residual : float
        Norm of what the weights leave of the gradient, relative to the gradient's; 1 if nothing balances.
    """

    active_set: ActiveSet
    weights: np.ndarray
    source: str
    residual: float

    def change(self, relaxation: np.ndarray, side: float | None = None) -> float:
        """Directional derivative of t_E if bounds are relaxed.

        The residual is the part of the gradient that the weights leave. Multipliers that make up no larger part of what
        the weights balance cannot be told from zero, and count as 0.

        Parameters
        ----------
        relaxation : (c,) ndarray
            Rates >= 0 at which the bounds of every row move outwards, dimensionless.
        side : {1, -1}, optional
            Only lower, or only upper bounds move.

        Returns
        -------
        float
            <= 0, s.
        """
        rates = np.zeros(len(self.weights))
        of_rows = relaxation[self.active_set.rows]
        if side is not None:
            of_rows = np.where(self.active_set.signs == side, of_rows, 0.0)
        rates[: len(of_rows)] = of_rows
        slopes = self.active_set.slopes
        balanced = np.linalg.norm(self.weights @ slopes)
        by_these = np.linalg.norm(np.where(rates > 0.0, self.weights, 0.0) @ slopes)
        if by_these <= self.residual * balanced:
            return 0.0
        saved = float(rates @ self.weights)
        if not self.active_set.dependent:
            return -saved
        from scipy.optimize import linprog

        # Of all weights that balance as much, those that promise the least.
        found = linprog(rates, A_eq=slopes.T, b_eq=self.weights @ slopes)
        return -float(rates @ (self.weights if found.x is None else found.x))


def multipliers_of(
    program: Program, x: np.ndarray, given: np.ndarray | None = None
) -> Multipliers:
    """Find the multipliers at an answer.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
    given : (c,) ndarray, optional
        The solver's own multipliers of the rows; L = t_E - given . rows.

    Returns
    -------
    Multipliers

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    gradient = program.gradient(x)
    sources = {"solver": given, "least squares": None}
    if given is None:
        del sources["solver"]
    tried = []
    # A row that is near its bound without being active would count as one that takes over within any step.
    for near in (1e-8, 1e-7, 1e-6, 1e-5):
        active_set = ActiveSet.at(program, x, near)
        for source, own in sources.items():
            weights = active_set.weights_of(gradient, own)
            rest = np.linalg.norm(gradient - weights @ active_set.slopes)
            residual = float(rest / np.linalg.norm(gradient))
            found = Multipliers(active_set, weights, source, residual)
            if residual <= 1e-5:
                return found
            tried.append(found)
    return min(tried, key=lambda multipliers: multipliers.residual)


TIMINGS = "timings"
"""Source of sensitivities that come from timings, without multipliers."""
_RAISED = 1e-3
"""Part by which limits are raised."""


def _outwards(bound: Bound) -> float:
    """Sign of a change of the figure that leaves more room."""
    return -1.0 if bound.side == "lower" else 1.0


@dataclass(frozen=True)
class Sensitivity:
    """What one figure of a limit costs.

    Attributes
    ----------
    limit : Limit
    bound : Bound
        The figure.
    derivative : float
        Derivative of t_E with respect to the figure, s per unit; <= 0 except at a lower end, which is raised by it.
    """

    limit: Limit
    bound: Bound
    derivative: float

    @property
    def label(self) -> Label:
        """What is limited, and the figure's unit."""
        return self.limit.labels[self.bound.column]

    def change(self, fraction: float) -> float:
        """Predict the change of t_E, s, for a limit that leaves more room by a fraction; 0.01 is +1 %."""
        return (
            _outwards(self.bound) * self.derivative * self.bound.full_scale * fraction
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "subject": self.label.subject,
            "kind": self.label.kind,
            "end": self.bound.side,
            "limit": self.bound.figure,
            "unit": self.label.unit,
            "derivative_s_per_unit": self.derivative,
            "change_for_1_percent_s": self.change(0.01),
            "change_for_10_percent_s": self.change(0.1),
        }


@dataclass(frozen=True)
class BranchBoundary:
    """What the branch's boundary costs; it limits the choice of redundant joints, not the robot.

    Attributes
    ----------
    label : str
        Of the margin.
    margin : float
        Least branch margin in force, dimensionless.
    derivative : float
        Derivative of t_E with respect to it, s.
    """

    label: str
    margin: float
    derivative: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "label": self.label,
            "margin": self.margin,
            "derivative_s": self.derivative,
        }


@dataclass(frozen=True, repr=False)
class Sensitivities(Summary):
    """What all limits cost.

    Attributes
    ----------
    limits : tuple of Sensitivity
        All figures of all limits but safeguards, the costliest first.
    boundaries : tuple of BranchBoundary
        Branch margins that hold the motion back.
    source : str
        Origin of the multipliers: ``"solver"`` or ``"least squares"``.
    residual : float
        Part of the gradient of t_E that they do not balance; an optimum has 0.
    unique : bool
        False if the multipliers are not unique: the derivatives then hold for more room only, not for less.
    """

    limits: tuple[Sensitivity, ...]
    boundaries: tuple[BranchBoundary, ...]
    source: str
    residual: float
    unique: bool

    @property
    def reliable(self) -> bool:
        """Whether the answer is an optimum, judged by the multipliers; otherwise they are rough."""
        return self.residual <= 1e-3  # relative to the gradient

    def of(self, subject: str, kind: str, end: str | None = None) -> Sensitivity:
        """Sensitivity to one figure, such as ``of("j1", "torque")``; KeyError if it does not exist."""
        wanted = (subject, kind, end)
        for entry in self.limits:
            if (entry.label.subject, entry.label.kind, entry.bound.side) == wanted:
                return entry
        raise KeyError(wanted)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "limits": [entry.to_dict() for entry in self.limits],
            "branch_boundaries": [entry.to_dict() for entry in self.boundaries],
            "multipliers": self.source,
            "residual": self.residual,
            "reliable": self.reliable,
            "unique": self.unique,
        }


def sensitivities(refined: SolvedProgram) -> Sensitivities:
    """Derive from a refined answer what every limit costs.

    Parameters
    ----------
    refined : SolvedProgram
        ``result.candidate.refined``.

    Returns
    -------
    Sensitivities
        Of the answer before its end time was lengthened to meet the limits between collocation points.
    """
    report = refined.report
    if report.solver == SOLVER:
        return sensitivities_of_timing(refined)
    multipliers = multipliers_of(refined.program, report.x, report.multipliers)
    return sensitivities_at(refined.program, multipliers)


def sensitivities_at(program: Program, multipliers: Multipliers) -> Sensitivities:
    """Derive what every limit costs from a problem and the multipliers of its answer."""
    found = []
    boundaries = []
    for limit in program.limits:
        rows = program.rows_of(limit)
        for bound in limit.bounds:
            rates = np.zeros(len(program.lower))
            rates[rows[:, bound.column]] = bound.per_unit
            if is_safeguard(limit):
                subject = limit.labels[bound.column].subject
                cost = -multipliers.change(rates)
                if cost > 1e-9:
                    boundaries.append(BranchBoundary(subject, bound.figure, cost))
                continue
            outwards = _outwards(bound)
            side = -outwards if bound.side else None
            derivative = outwards * multipliers.change(rates, side)
            found.append(Sensitivity(limit, bound, derivative))
    found.sort(key=lambda entry: entry.change(1.0))
    return Sensitivities(
        tuple(found),
        tuple(boundaries),
        multipliers.source,
        multipliers.residual,
        not multipliers.active_set.dependent,
    )


def sensitivities_of_timing(refined: SolvedProgram) -> Sensitivities:
    """Time the joint path of a motion again with each limit raised by 0.1 %.

    This is right where the joint path is given. Where it is free, two limits may be active at once all along it: then
    raising one of them saves nothing unless the joint path changes too.

    Parameters
    ----------
    refined : SolvedProgram
        Timed by the phase plane.

    Returns
    -------
    Sensitivities
        Those of limits that a slower motion does not relieve are zero.
    """
    costs: defaultdict[tuple[Limit, Bound], float] = defaultdict(float)
    for phase, x in refined.program.split(refined.x):
        own = PhaseTiming.of(phase, x)
        if own is None or own.timing is None:
            continue
        evaluation = phase.evaluate(x)
        for limit, values in zip(phase.limits, evaluation.by_limit, strict=True):
            if is_safeguard(limit):
                continue
            nearest = limit.violation(values).max(axis=0)
            for bound in limit.bounds:
                is_near = nearest[bound.column] > -0.02  # as a part of the limit
                is_relieved = is_near and limit.longer_time == "relieves"
                cost = _cost(own, limit, bound) if is_relieved else 0.0
                costs[limit, bound] += cost
    found = []
    for (limit, bound), cost in costs.items():
        derivative = _outwards(bound) * cost / (_RAISED * bound.full_scale)
        found.append(Sensitivity(limit, bound, derivative))
    found.sort(key=lambda entry: entry.change(1.0))
    return Sensitivities(tuple(found), (), TIMINGS, 0.0, unique=True)


def _cost(own: PhaseTiming, limit: Limit, bound: Bound) -> float:
    """Change of the least time of a joint path, s, if a bound is moved outwards."""
    timing = own.timing
    assert timing is not None
    sides = {None: [0, 1], "lower": [0], "upper": [1]}[bound.side]
    nearer = np.zeros((2, len(timing.acceleration), len(limit.labels)))
    nearer[sides, :, bound.column] = -_RAISED * bound.full_scale * bound.per_unit
    raised = own.course.solve(own.rates, {limit: nearer})
    return 0.0 if raised is None else raised.t_end - timing.t_end
