"""The plain transcription: all joints and s are splines, and the path is a set of equations; see `restarts`.

    variables   x = (t_E, control points of s, of q_1, ..., of q_n), the boundary conditions built in as in `nlp`
    minimise    t_E
    subject to  the limits at the collocation points,  ds/dt >= 0,
                f(q(t_k)) - z(s(t_k)) = 0  at the Greville abscissae t_k of the free control points.

There are as many equations in each row of the task space as a joint has free control points. So the program has the
freedom of y = (s, q_r) over the same knots, without a choice of redundant joints, and without its singularities; at
more points the equations would over-determine the splines. In between the path is met to the splines' accuracy alone.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.common.arrays import spread
from brachis.kinematics import JointDerivatives, JointMap, JointState
from brachis.optimise.boundary import Boundary, LocalBasis, SparsityPattern, greville
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.transcription import breaks_of
from brachis.path import Path
from brachis.problem.problem import Problem
from brachis.robot import TaskMap


class AllJointsMap(JointMap):
    """y = (s, q) as a `JointMap`: the joints do not know of s.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self.robot = problem.robot
        self.start = np.zeros(self.robot.n)
        self.r = self.robot.n
        self.redundant_joints = self.robot.joint_names
        self.path = problem.path

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
        return np.append(s, q)

    def postures(self, y: np.ndarray) -> np.ndarray:
        """See `JointMap`."""
        return y[:, 1:]

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        **_turns: object,
    ) -> JointState:
        """See `JointMap`."""
        gradient = np.broadcast_to(
            np.eye(self.r, self.r + 1, 1), (len(y), self.r, self.r + 1)
        )
        return JointState(
            self, y, ydot, yddot, ydddot, y[:, 1:], ydot[:, 1:], yddot[:, 1:], gradient
        )

    def derivatives(self, state: JointState) -> JointDerivatives:
        """See `JointMap`: all derivatives but the gradient vanish."""
        zeros = np.zeros_like(state.gradient)
        return JointDerivatives(zeros, zeros, zeros)


class FullSpace:
    """The transcription as a `brachis.optimise.backends.protocol.NonlinearProgram`.

    Parameters
    ----------
    problem : Problem
        Task on a robot.
    points : int
        Collocation points per knot interval at which the limits hold.
    """

    def __init__(self, problem: Problem, points: int) -> None:
        spline, robot = problem.task.spline, problem.robot
        joint_map = AllJointsMap(problem)
        breaks = breaks_of(problem)
        free = np.full(robot.n, np.nan)
        ends = [
            free if posture is None else posture
            for posture in (problem.start, problem.end)
        ]
        order = spline.vanishing
        boundary = Boundary.at_rest(
            joint_map.coordinates(0.0, ends[0]),
            joint_map.coordinates(1.0, ends[1]),
            order,
        )
        grid = FixedGrid(
            clamped_knots(spline.degree, breaks), spline.degree, spread(breaks, points)
        )
        self.task_map, self.path = problem.task_map, problem.path
        self.phase = Phase(joint_map, problem.limits, grid, boundary)
        self.program = Program([self.phase])
        self.x_lower, self.x_upper = self.program.x_lower, self.program.x_upper
        self._equations(
            order + 1, [posture is None for posture in (problem.start, problem.end)]
        )

    def _equations(self, still: int, free: list[bool]) -> None:
        """Lay the path's equations out; `still` control points at each end are one, which is free or not."""
        inner = greville(self.phase.knots, self.phase.degree)[still:-still]
        self.t_norm = np.concatenate([[0.0][: free[0]], inner, [1.0][: free[1]]])
        self._basis = LocalBasis.of(self.phase.knots, self.phase.degree, self.t_norm)
        self._places = [
            SparsityPattern(self._basis.columns, spline.free_matrix, 1)
            for spline in self.phase.splines
        ]
        self._values = [
            places.entries(self._basis.values)[0] for places in self._places
        ]
        m, first = self.task_map.m, len(self.program.lower)
        zeros = np.zeros(len(self.t_norm) * m)
        self.lower, self.upper = (
            np.append(side, zeros) for side in (self.program.lower, self.program.upper)
        )
        rows, columns = [self.program.jacobian_rows], [self.program.jacobian_columns]
        for places, part in zip(self._places, self.phase.slices, strict=True):
            rows.append((first + places.point[:, None] * m + np.arange(m)).ravel())
            columns.append(np.repeat(places.variable + part.start, m))
        self.jacobian_rows, self.jacobian_columns = (
            np.concatenate(rows),
            np.concatenate(columns),
        )

    def objective(self, x: np.ndarray) -> float:
        """End time, s."""
        return self.program.objective(x)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient of the end time."""
        return self.program.gradient(x)

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Rows of the program, then the path's equations."""
        miss, _ = misses(self.task_map, self.path, self._curves(x))
        return np.append(self.program.rows(x), miss.ravel())

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian on its pattern."""
        _, slopes = misses(self.task_map, self.path, self._curves(x))
        entries = [self.program.jacobian(x)]
        for j, (places, values) in enumerate(
            zip(self._places, self._values, strict=True)
        ):
            entries.append((slopes[places.point, :, j] * values[:, None]).ravel())
        return np.concatenate(entries)

    def _curves(self, x: np.ndarray) -> np.ndarray:
        """y = (s, q), (K, 1 + n), where the path's equations are."""
        return self._basis.curves(self.phase.motion(x).control_points)[0]

    def starting_point(self, joint_path: np.ndarray, t_end: float) -> np.ndarray:
        """Point x of a motion along a joint path, (K, n), at equal steps of s, that speeds up and slows down evenly."""
        t = greville(self.phase.knots, self.phase.degree)
        s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
        at = np.linspace(0.0, 1.0, len(joint_path))
        points = np.array([s, *(np.interp(s, at, joint) for joint in joint_path.T)])
        return self.phase.variables_from(
            Motion(t_end, self.phase.knots, self.phase.degree, points)
        )

    def in_between(self, x: np.ndarray) -> tuple[float, float]:
        """Largest excess over a limit, and largest distance from the path, m or rad, at any time."""
        t_norm = np.linspace(0.0, 1.0, 2001)
        motion = self.phase.motion(x)
        miss, _ = misses(self.task_map, self.path, motion.at(t_norm * motion.t_end)[0])
        return float(self.phase.violation_at(x, t_norm).max()), float(
            np.abs(miss).max()
        )


def misses(
    task_map: TaskMap, path: Path, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements, (K, m), from the path's targets to where the tool is, and their derivatives by y, (K, m, 1 + n).

    Of poses they are logarithms of SE(3), whose derivative is known; of rows plain differences.
    """
    s, q = y[:, 0], y[:, 1:]
    sample, values = path.sample(s), task_map.values(q)
    jacobian = task_map.jacobian(task_map.twists(q))
    if values.shape[1] == task_map.m:
        slopes = np.concatenate([-sample.xi[:, :, None], jacobian], axis=2)
        return task_map.difference(values, sample.target), slopes
    miss, slopes = np.empty((len(y), 6)), np.empty((len(y), 6, y.shape[1]))
    for k, (value, target) in enumerate(zip(values, sample.target, strict=True)):
        tool, wanted = (
            pin.SE3(pose[3:].reshape(3, 3), pose[:3]) for pose in (value, target)
        )
        gap = wanted.actInv(tool)
        miss[k] = pin.log6(gap).vector
        by_body = pin.Jlog6(gap)
        slopes[k, :, 0] = -by_body @ gap.actionInverse @ sample.xi[k]
        slopes[k, :, 1:] = by_body @ jacobian[k]
    return miss, slopes
