"""Trajectories from solutions of programs. Each phase begins exactly where the one before it ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cut
from brachis.kinematics import ChartMap, Nodes, interpolate, join_nodes
from brachis.optimise.links import CurveLink, PostureLink
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.problem.chain import ProblemChain, Section
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.task import Task
from brachis.trajectory import (
    CONTINUOUS_TORQUE,
    Event,
    MotionPart,
    PhaseSpline,
    Trajectory,
    join_splines,
)


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
    return make_trajectory(task, program.phases, join_motions(program, x))


def extract_motion(problem: Problem, program: Program, x: np.ndarray) -> Trajectory:
    """Turn a point of the program of a problem into a trajectory; raise as `extract_trajectory` does.

    If the problem has several parts, the trajectory is that of a move, and has the trajectories of the parts as its
    components.
    """
    if not problem.is_chain:
        return extract_trajectory(problem.task, program, x)
    motions = join_motions(program, x)
    trajectories = []
    first = 0
    for part in problem.parts:
        legs = slice(first, first + len(part.legs))
        trajectories.append(
            make_trajectory(part.task, program.phases[legs], motions[legs])
        )
        first = legs.stop
    return compose(problem, trajectories)


def compose(problem: Problem, trajectories: Sequence[Trajectory]) -> Trajectory:
    """Join the trajectories of the parts of a problem, with the waits between them, to the motion of a move."""
    components = []
    begin = 0.0
    for part, trajectory in zip(problem.parts, trajectories, strict=True):
        components.append((begin, trajectory))
        begin += trajectory.t_end + part.legs[-1].dwell
    composed = _compose(problem, components, begin)
    sections = list(_time_sections(problem, components))
    events = [
        Event(mark.name, (part.begin if mark.at == "start" else part.end) - mark.lead)
        for section, part in sections
        for mark in section.marks
    ]
    return replace(
        composed,
        parts=tuple(part for _, part in sections),
        events=tuple(sorted(events, key=lambda event: event.time)),
    )


def _time_sections(
    problem: Problem, components: Sequence[tuple[float, Trajectory]]
) -> Iterator[tuple[Section, MotionPart]]:
    """Yield the sections of all parts of a problem, with their times."""
    assert isinstance(problem, ProblemChain)
    for sections, (first, component) in zip(problem.sections, components, strict=True):
        begin = first
        for section in sections:
            reached = [
                phase.end
                for phase in component.phases
                if abs(phase.s_end - section.s_end) < tolerances.PATH
                and not phase.is_dwell
            ]
            end = first + max(reached)
            if section.kind == "dwell":
                end = begin + section.dwell
            travel = component.task.travel if section.kind == "path" else ""
            yield section, MotionPart(section.name, section.kind, begin, end, travel)
            begin = end


def _compose(
    problem: Problem, components: Sequence[tuple[float, Trajectory]], end: float
) -> Trajectory:
    """Join components, with a wait after each that does not end when the next one begins, to the motion of a move.

    The path coordinate of component k of n goes from k / n to (k + 1) / n.
    """
    robot = problem.robot
    count = len(components)
    ends = [*(begin for begin, _ in components[1:]), end]
    splines: list[PhaseSpline] = []
    nodes: list[Nodes] = []
    for number, (begin, trajectory) in enumerate(components):
        motion = (
            trajectory.q,
            trajectory.qdot,
            trajectory.qddot,
            trajectory.qddot_before,
        )
        nodes.append(
            Nodes(trajectory.times, *(values[:, : robot.n] for values in motion))
        )
        for spline in trajectory.phase_splines:
            s = (number + spline.control_points[:1]) / count
            splines.append(replace(spline, control_points=s))
        wait = ends[number] - (begin + trajectory.t_end)
        if wait > 0.0:
            splines.append(splines[-1].wait(wait))
            nodes.append(_stand_still(nodes[-1], wait))
    first = components[0][1]
    return _assemble(
        splines,
        nodes,
        task=problem.task,
        robot=robot,
        own_limits=first.own_limits,
        components=tuple(components),
    )


def _assemble(
    splines: Sequence[PhaseSpline], nodes: Sequence[Nodes], robot: Robot, **facts: Any
) -> Trajectory:
    """Join the splines and nodes of successive phases to a trajectory."""
    joined = join_nodes(nodes)
    knots, control_points = join_splines(splines)
    # Sums of durations differ from the times of the nodes by rounding.
    phase_ends = np.cumsum([spline.t_end for spline in splines])
    nearest = np.abs(joined.times[:, None] - phase_ends).argmin(axis=0)
    in_coordinates = {
        "redundant_joints": (),
        "branch": "",
        "chart_rows": np.empty((0, 0, 0)),
        "chart_knots": np.empty(0),
    }
    return Trajectory(
        robot=robot,
        urdf=robot.urdf,
        times=joined.times,
        q=joined.q,
        qdot=joined.qdot,
        qddot=joined.qddot,
        qddot_before=joined.qddot_before,
        knots=knots,
        degree=splines[0].degree,
        control_points=control_points,
        phase_ends=joined.times[nearest],
        **in_coordinates | facts,
    )


def make_trajectory(
    task: Task, phases: Sequence[Phase], motions: Sequence[Motion]
) -> Trajectory:
    """Return the trajectory of successive phases in coordinates of one joint map; raise as `extract_trajectory` does.

    Parameters
    ----------
    task : Task
    phases : sequence of Phase
    motions : sequence of Motion
        Motions of the phases; see `join_motions`.
    """
    sections: list[_Section] = []
    for phase, motion in zip(phases, motions, strict=True):
        before = sections[-1] if sections else None
        if before is not None and before.pause:
            sections.append(before.wait())
        sections.append(_Section.of(phase, motion, before))
    joint_map = phases[0].joint_map
    facts: dict[str, Any] = {}
    if isinstance(joint_map, ChartMap):
        facts["chart_rows"] = joint_map.rows.coefficients
        facts["chart_knots"] = joint_map.rows.knots
    own_limits = tuple(
        limit.name
        for limit in phases[0].limits
        if limit.origin.startswith("own_limits")
    )
    return _assemble(
        [section.spline for section in sections],
        [section.nodes for section in sections],
        task=task,
        robot=joint_map.robot,
        redundant_joints=joint_map.redundant_joints,
        branch=joint_map.branch_label,
        own_limits=own_limits,
        **facts,
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
        nodes = _stand_still(self.nodes, self.pause)
        return _Section(self.spline.wait(self.pause), nodes)


def _stand_still(nodes: Nodes, duration: float) -> Nodes:
    """Return the nodes of a wait in the posture in which a motion ends."""
    q = np.tile(nodes.q[-1], (2, 1))
    still = np.zeros_like(q)
    return Nodes(np.array([0.0, duration]), q, still, still, still)


def meet(program: Program, x: np.ndarray) -> np.ndarray:
    """Return the point x at which moves end exactly where the parts beside them begin; see `join_motions`."""
    if all(isinstance(link, CurveLink) for link in program.links):
        return x
    return program.variables_from(join_motions(program, x))


def join_motions(program: Program, x: np.ndarray) -> list[Motion]:
    """Return the motions of all phases, linked exactly. A solver links phases only to within its tolerance."""
    motions = program.motions(x)
    states = program.states(x)
    for link in program.links:
        if isinstance(link, CurveLink):
            before = motions[link.before]
            last = np.array(before.at(np.array([before.t_end])))[:, 0]
            after = program.phases[link.after]
            motions[link.after] = _begin_with(motions[link.after], after, link, last)
        else:
            assert isinstance(link, PostureLink)
            (moved, end), (kept, place) = link.sides(program.phases)
            state = states[kept]
            orders = np.array([state.q, state.qdot, state.qddot])[:, place]
            linked = orders[: 1 + max(link.orders)]
            motions[moved] = _meet(motions[moved], program.phases[moved], end, linked)
    return motions


def _meet(motion: Motion, phase: Phase, end: int, orders: np.ndarray) -> Motion:
    """Return the motion of a phase that has a posture and k derivatives, (1 + k, n or more), at one end."""
    joint_map = phase.joint_map
    fixed = (phase.boundary.start, phase.boundary.end)[end][-1].given
    s = float(motion.at(np.array([0.0, motion.t_end])[[end]])[0][0, 0])
    y = joint_map.coordinates(s, orders[0, : joint_map.robot.n])[1:]
    values = np.zeros((max(1 + len(fixed), len(orders)), len(y)))
    values[0] = y
    # Only moves have derivatives that are linked: their curves are the joints.
    values[1 : len(orders)] = orders[1:, : len(y)]
    curves = range(1 - phase.boundary.law_curves, len(motion.control_points))
    return motion.with_end(end, values, list(curves))


def _begin_with(
    motion: Motion, phase: Phase, link: CurveLink, last: np.ndarray
) -> Motion:
    """Return the motion with a new start: a link sets some values and derivatives to those of `last`, (4, c)."""
    orders = np.array(motion.at(np.zeros(1)))[:, 0]
    fixed_derivatives = phase.boundary.start[-1].given
    fixed_orders = len(fixed_derivatives)
    # Set them exactly: in an interval of microseconds, a rounding error becomes an acceleration not allowed at rest.
    orders[1 : 1 + fixed_orders, list(link.curves)] = fixed_derivatives[:, None]
    joined = np.ix_(link.orders, link.curves)
    orders[joined] = last[joined]
    count = 1 + max(fixed_orders, *link.orders)
    curves = [curve - phase.boundary.law_curves for curve in link.curves]
    return motion.with_end(0, orders[:count, list(link.curves)], curves)
