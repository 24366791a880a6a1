"""Trajectories from the answers of programs: phase after phase, each going on exactly as the one before ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.kinematics import ChartMap, Nodes, interpolate, join_nodes
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Link, Program
from brachis.task import Task
from brachis.trajectory import CONTINUOUS_TORQUE, PhaseSpline, Trajectory, join_splines


def extract_trajectory(task: Task, solved: SolvedProgram) -> Trajectory:
    """Turn the answer of a program into a trajectory that can be evaluated without the closed form.

    Parameters
    ----------
    task : Task
    solved : SolvedProgram

    Returns
    -------
    Trajectory

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the collocation points.
    """
    parts = [_Part.of(solved, 0)]
    for number in range(1, len(solved.program.phases)):
        if parts[-1].pause:
            parts.append(parts[-1].wait())
        parts.append(_Part.of(solved, number, parts[-1]))
    splines = [part.spline for part in parts]
    knots, control_points = join_splines(splines)
    joint_map = solved.program.phases[0].joint_map
    rows = np.empty((0, 0, 0))
    chart_knots = np.empty(0)
    if isinstance(joint_map, ChartMap):
        rows, chart_knots = joint_map.rows.arrays()
    nodes = join_nodes([part.nodes for part in parts])
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
        phase_ends=np.cumsum([part.nodes.times[-1] for part in parts]),
        chart_rows=rows,
        chart_knots=chart_knots,
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """A phase of a trajectory: its curves, its nodes, and how long the arm waits after it, s."""

    spline: PhaseSpline
    nodes: Nodes
    pause: float = 0.0
    motion: Motion | None = None

    @classmethod
    def of(
        cls, solved: SolvedProgram, number: int, before: _Part | None = None
    ) -> _Part:
        """Extract a phase that goes on exactly as the part before it ends."""
        phase, x = solved.program.split(solved.x)[number]
        motion = phase.motion(x)
        joint_map = phase.joint_map
        path = joint_map.path
        assert path is not None
        if before is not None:
            joint_map = joint_map.along(path, before.nodes.q[-1])
            motion = _continue(
                motion, phase, before, _find_link(solved.program, number)
            )
        joins = motion.times_of(_select_inside(path.breaks, motion))
        gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
        breaks = np.union1d(motion.breaks, joins[gaps > 1e-7 * motion.t_end])
        jumps = motion.degree < CONTINUOUS_TORQUE
        nodes = interpolate(joint_map, motion.at, breaks, jumps=jumps)
        return cls(motion.as_spline(), nodes, phase.pause, motion)

    def wait(self) -> _Part:
        """Wait at rest where this part ends."""
        degree = self.spline.degree
        knots = clamped_knots(degree, np.array([0.0, 1.0]))
        points = np.repeat(self.spline.control_points[:, -1:], degree + 1, axis=1)
        q = np.tile(self.nodes.q[-1], (2, 1))
        still = np.zeros_like(q)
        times = np.array([0.0, self.pause])
        nodes = Nodes(times, q, still, still, still, 0.0)
        return _Part(PhaseSpline(self.pause, knots, degree, points), nodes)


def _find_link(program: Program, number: int) -> Link | None:
    """Return the link from the phase before; None without one."""
    pair = (number - 1, number)
    links = (link for link in program.links if (link.before, link.after) == pair)
    return next(links, None)


def _continue(motion: Motion, phase: Phase, before: _Part, link: Link | None) -> Motion:
    """Let the redundant curves begin exactly as those of the part before end, which a link holds to rounding."""
    if link is None:
        return motion
    if before.motion is None:
        last = before.spline.control_points[1:, -1][None]
    else:
        ends = before.motion.at(np.array([before.motion.t_end]))
        last = np.array([ends[order][0, 1:] for order in link.orders])
    first = phase.boundary.given
    own = motion.at(np.zeros(1))
    given = len(phase.boundary.start[-1].derivatives)
    count = max(len(last), 1 + given)
    values = np.array([curves[0, first:] for curves in own[:count]])
    values[: len(last), 1 - first :] = last
    return motion.with_start(values)


def _select_inside(s: np.ndarray, motion: Motion) -> np.ndarray:
    """Select of path coordinates, (P,), those between the ends of a motion."""
    begin, end = motion.at(np.array([0.0, motion.t_end]))[0][:, 0]
    return s[(s > begin) & (s < end)]
