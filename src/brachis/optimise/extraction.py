"""Trajectories from solutions of programs. Each phase begins exactly where the one before it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cut
from brachis.kinematics import ChartMap, Nodes, interpolate, join_nodes
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Link, Program
from brachis.task import Task
from brachis.trajectory import CONTINUOUS_TORQUE, PhaseSpline, Trajectory, join_splines


def extract_trajectory(task: Task, program: Program, x: np.ndarray) -> Trajectory:
    """Turn a point of a program into a trajectory that can be evaluated without the closed-form inverse kinematics.

    Parameters
    ----------
    task : Task
    program : Program
    x : (v,) ndarray

    Returns
    -------
    Trajectory

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the collocation points.
    """
    sections: list[_Section] = []
    for phase, motion in zip(program.phases, _join(program, x), strict=True):
        before = sections[-1] if sections else None
        if before is not None and before.pause:
            sections.append(before.wait())
        sections.append(_Section.of(phase, motion, before))
    splines = [section.spline for section in sections]
    knots, control_points = join_splines(splines)
    joint_map = program.phases[0].joint_map
    rows = np.empty((0, 0, 0))
    chart_knots = np.empty(0)
    if isinstance(joint_map, ChartMap):
        rows = joint_map.rows.coefficients
        chart_knots = joint_map.rows.knots
    nodes = join_nodes([section.nodes for section in sections])
    limits = program.phases[0].limits
    own_limits = tuple(
        limit.name for limit in limits if limit.origin.startswith("own_limits")
    )
    return Trajectory(
        task=task,
        urdf=joint_map.robot.urdf,
        robot=joint_map.robot,
        redundant_joints=joint_map.redundant_joints,
        branch=joint_map.branch_label,
        times=nodes.times,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot_before,
        knots=knots,
        degree=splines[0].degree,
        control_points=control_points,
        phase_ends=np.cumsum([section.nodes.times[-1] for section in sections]),
        chart_rows=rows,
        chart_knots=chart_knots,
        own_limits=own_limits,
    )


@dataclass(frozen=True, eq=False)
class _Section:
    """A phase of a trajectory: its curves, its nodes, and the pause after it, s."""

    spline: PhaseSpline
    nodes: Nodes
    pause: float = 0.0

    @classmethod
    def of(cls, phase: Phase, motion: Motion, before: _Section | None) -> _Section:
        """Extract the motion of a phase, which begins in the posture in which the section before it ends."""
        joint_map = phase.joint_map
        path = joint_map.path
        assert path is not None
        if before is not None:
            joint_map = joint_map.along(path, before.nodes.q[-1])
        begin, end = motion.at(np.array([0.0, motion.t_end]))[0][:, 0]
        joins = motion.times_of(cut(path.breaks, begin, end)[1:-1])
        gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
        breaks = np.union1d(motion.breaks, joins[gaps > 1e-7 * motion.t_end])
        jumps = motion.degree < CONTINUOUS_TORQUE
        nodes = interpolate(joint_map, motion.at, breaks, jumps=jumps)
        return cls(motion.as_spline(), nodes, phase.pause)

    def wait(self) -> _Section:
        """Return the section of the pause, in which the arm waits at rest where this section ends."""
        q = np.tile(self.nodes.q[-1], (2, 1))
        still = np.zeros_like(q)
        times = np.array([0.0, self.pause])
        nodes = Nodes(times, q, still, still, still)
        return _Section(self.spline.wait(self.pause), nodes)


def _join(program: Program, x: np.ndarray) -> list[Motion]:
    """Return the motions of all phases, linked exactly. A solver links phases only to within its tolerance."""
    motions = program.motions(x)
    for link in program.links:
        before = motions[link.before]
        last = np.array(before.at(np.array([before.t_end])))[:, 0]
        motions[link.after] = _begin_with(
            motions[link.after], program.phases[link.after], link, last
        )
    return motions


def _begin_with(motion: Motion, phase: Phase, link: Link, last: np.ndarray) -> Motion:
    """Return the motion with a new start: a link sets some values and derivatives to those of `last`, (4, c)."""
    orders = np.array(motion.at(np.zeros(1)))[:, 0]
    fixed_derivatives = phase.boundary.start[-1].derivatives
    fixed_orders = len(fixed_derivatives)
    # Set them exactly: in an interval of microseconds, a rounding error becomes an acceleration not allowed at rest.
    orders[1 : 1 + fixed_orders, list(link.curves)] = fixed_derivatives[:, None]
    joined = np.ix_(link.orders, link.curves)
    orders[joined] = last[joined]
    count = 1 + max(fixed_orders, *link.orders)
    curves = [curve - phase.boundary.law_curves for curve in link.curves]
    return motion.with_start(orders[:count, list(link.curves)], curves)
