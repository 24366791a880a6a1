"""CasADi and IPOPT: a lifted transcription with exact Hessians, as an expert writes it.

Variables are the duration, the control points of s(t) and q_r(t), and at every collocation point positions, rates and
accelerations of the other joints. That the tool is on its path, with its first and second derivative by time, are
equations. The dynamics are a recursive Newton-Euler algorithm in CasADi's symbols, of the same chain.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from brachis.kinematics import JointMap
from brachis.optimise.bspline import clamped_knots, local_basis
from brachis.planner import transcribe
from peers.lines import INTERVALS, Answer, Line

DEGREE = 3
POINTS = 3
"""Collocation points an interval."""
_LEAST = 0.05
"""Least duration, as a fraction of the guessed one."""


def solve(line: Line) -> Answer:
    """Set the program up, and solve it from the joint path of the pseudo-inverse."""
    import casadi as ca

    began = time.process_time()
    robot = line.robot
    n = robot.n
    free = [line.redundant]
    others = [i for i in range(n) if i not in free]
    m = len(others)
    knots = clamped_knots(DEGREE, np.linspace(0.0, 1.0, INTERVALS + 1))
    at = np.linspace(0.0, 1.0, POINTS * INTERVALS + 1)
    first, values = local_basis(knots, DEGREE, at)
    count = INTERVALS + DEGREE
    bases = np.zeros((3, len(at), count))
    for order in range(3):
        places = first[:, None] + np.arange(DEGREE + 1)
        np.put_along_axis(bases[order], places, values[order], axis=1)

    duration = ca.SX.sym("T")
    control = ca.SX.sym("c", count, 2)
    lifted = [ca.SX.sym(name, m, len(at)) for name in ("q", "v", "a")]
    curves = [
        ca.mtimes(basis, control) / duration**order for order, basis in enumerate(bases)
    ]
    rows = _rows_of_point(ca, line, others)
    rows_of_all = rows.map(len(at))
    joints = []
    for own, given in zip(lifted, curves, strict=True):
        whole = [None] * n
        for number, joint in enumerate(others):
            whole[joint] = own[number, :]
        whole[free[0]] = given[:, 1].T
        joints.append(ca.vertcat(*whole))
    path = [given[:, 0].T for given in curves]
    equations, torque = rows_of_all(*joints, *path)
    progress = control[1:, 0] - control[:-1, 0]
    limits = robot.limits
    ends = ca.vertcat(
        control[:3, 0],
        1.0 - control[-3:, 0],
        control[:3, 1] - line.start[free[0]],
        control[-2, 1] - control[-1, 1],
        control[-3, 1] - control[-1, 1],
        lifted[0][:, 0] - line.start[others],
    )
    parts: list[tuple[Any, float, float]] = [
        (ca.vec(equations), 0.0, 0.0),
        (ends, 0.0, 0.0),
        (ca.vec(torque), -1.0, 1.0),
        (progress, 0.0, np.inf),
    ]
    if np.isfinite(limits.velocity).all():
        parts.append((ca.vec(joints[1] / limits.velocity), -1.0, 1.0))
    if np.isfinite(limits.position_lower).all():
        middle = 0.5 * (limits.position_lower + limits.position_upper)
        half = 0.5 * (limits.position_upper - limits.position_lower)
        parts.append((ca.vec((joints[0] - middle) / half), -1.0, 1.0))
    x = ca.vertcat(duration, ca.vec(control), *map(ca.vec, lifted))
    solver = ca.nlpsol(
        "solver",
        "ipopt",
        {"x": x, "f": duration, "g": ca.vertcat(*(part for part, _, _ in parts))},
        {
            "ipopt.print_level": 0,
            "print_time": False,
            "ipopt.sb": "yes",
            "ipopt.max_iter": 500,
            "ipopt.bound_relax_factor": 0.0,  # exact bounds; this also takes fewer iterations here
        },
    )
    ready = time.process_time()
    guess = _guess(line, at, others, free[0], count)
    sizes = [part.numel() for part, _, _ in parts]
    found = solver(
        x0=guess,
        lbx=np.append(_LEAST * guess[0], np.full(len(guess) - 1, -np.inf)),
        ubx=np.inf,
        lbg=np.repeat([low for _, low, _ in parts], sizes),
        ubg=np.repeat([high for _, _, high in parts], sizes),
    )
    ended = time.process_time()
    answer = np.array(found["x"]).ravel()
    t_end = float(answer[0])
    points = answer[1 : 1 + 2 * count].reshape(2, count)
    joint_map = transcribe(line.task)[0].phases[0].joint_map
    return Answer(
        ready - began,
        ended - ready,
        t_end if solver.stats()["success"] else np.nan,
        lambda t: _sample(joint_map, knots, points, t_end, t),
    )


def _rows_of_point(ca: Any, line: Line, others: list[int]) -> Any:
    """Return a function of q, qdot, qddot, s, sdot, sddot: equations of the path, and torque over its limit."""
    n = line.robot.n
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    s, sdot, sddot = (ca.SX.sym(name) for name in ("s", "sdot", "sddot"))
    begin, end = line.targets(np.array([0.0, 1.0]))
    position, rotation = _tool(ca, line, q)
    if len(others) == len(line.problem.task_map.axes):
        axes = list(line.problem.task_map.axes)
        miss = position[axes] - (begin + s * (end - begin))
    else:
        kept = begin[3:].reshape(3, 3)  # the line turns nothing
        turned = ca.mtimes(kept.T, rotation)
        miss = ca.vertcat(
            position - (begin[:3] + s * (end[:3] - begin[:3])),
            turned[2, 1] - turned[1, 2],
            turned[0, 2] - turned[2, 0],
            turned[1, 0] - turned[0, 1],
        )
    rate = ca.jtimes(miss, ca.vertcat(q, s), ca.vertcat(v, sdot))
    more = ca.jtimes(rate, ca.vertcat(q, s, v, sdot), ca.vertcat(v, sdot, a, sddot))
    torque = _torque(ca, line, q, v, a) / line.robot.limits.torque
    return ca.Function(
        "rows", [q, v, a, s, sdot, sddot], [ca.vertcat(miss, rate, more), torque]
    )


def _turns(ca: Any, axis: np.ndarray, angle: Any) -> Any:
    """Rotation matrix about a unit axis."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (
        np.eye(3) + ca.sin(angle) * across + (1.0 - ca.cos(angle)) * (across @ across)
    )


def _steps(ca: Any, line: Line, q: Any) -> list[tuple[Any, Any]]:
    """Placement of every body in the frame of the one before it; all frames are parallel at the zero posture."""
    chain = line.robot.chain
    origins = np.vstack([np.zeros(3), chain.points])
    steps = []
    for i in range(chain.n):
        shift = origins[i + 1] - origins[i]
        axis = chain.axes[i]
        if chain.revolute[i]:
            steps.append((_turns(ca, axis, q[i]), shift))
        else:
            steps.append((np.eye(3), shift + axis * q[i]))
    return steps


def _tool(ca: Any, line: Line, q: Any) -> tuple[Any, Any]:
    """Place the tool: position and rotation."""
    chain = line.robot.chain
    position = chain.tool_position - chain.points[-1]
    rotation = chain.tool_rotation
    for turn, shift in reversed(_steps(ca, line, q)):
        position = ca.mtimes(turn, position) + shift
        rotation = ca.mtimes(turn, rotation)
    return position, rotation


def _torque(ca: Any, line: Line, q: Any, v: Any, a: Any) -> Any:
    """Joint torques by the recursive Newton-Euler algorithm, with friction."""
    chain = line.robot.chain
    steps = _steps(ca, line, q)
    spin = ca.SX.zeros(3)
    turning = ca.SX.zeros(3)
    moving = ca.SX(-np.array(chain.gravity))
    loads = []
    for i, (turn, shift) in enumerate(steps):
        axis = ca.DM(chain.axes[i])
        moving = ca.mtimes(
            turn.T,
            moving + ca.cross(turning, shift) + ca.cross(spin, ca.cross(spin, shift)),
        )
        before = ca.mtimes(turn.T, spin)
        turning = ca.mtimes(turn.T, turning)
        spin = before
        if chain.revolute[i]:
            turning = turning + axis * a[i] + ca.cross(before, axis * v[i])
            spin = before + axis * v[i]
        else:
            moving = moving + axis * a[i] + 2.0 * ca.cross(spin, axis * v[i])
        center = chain.centers[i] - chain.points[i]
        xx, xy, xz, yy, yz, zz = chain.inertias[i]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        force = chain.masses[i] * (
            moving + ca.cross(turning, center) + ca.cross(spin, ca.cross(spin, center))
        )
        moment = ca.mtimes(inertia, turning) + ca.cross(spin, ca.mtimes(inertia, spin))
        loads.append((force, moment + ca.cross(center, force)))
    torque = []
    force, moment = (ca.SX.zeros(3), ca.SX.zeros(3))
    for i in reversed(range(chain.n)):
        force = force + loads[i][0]
        moment = moment + loads[i][1]
        torque.append(ca.dot(chain.axes[i], moment if chain.revolute[i] else force))
        turn, shift = steps[i]
        force = ca.mtimes(turn, force)
        moment = ca.mtimes(turn, moment) + ca.cross(shift, force)
    friction = line.robot.friction
    own = (
        friction.armature * a
        + friction.viscous * v
        + friction.coulomb * ca.tanh(v / friction.v_eps)
    )
    return ca.vertcat(*reversed(torque)) + own


def _guess(
    line: Line, at: np.ndarray, others: list[int], free: int, count: int
) -> np.ndarray:
    """Put the joint path of the pseudo-inverse into the variables, timed by a quintic that starts and ends at rest."""
    s_path, q_path = line.joint_path()
    knots = clamped_knots(DEGREE, np.linspace(0.0, 1.0, INTERVALS + 1))
    greville = np.array([knots[i + 1 : i + 1 + DEGREE].mean() for i in range(count)])

    def law(t: np.ndarray) -> np.ndarray:
        return t**3 * (10.0 - 15.0 * t + 6.0 * t * t)

    fine = np.linspace(0.0, 1.0, 2001)
    s_of = law(fine)
    q_of = np.column_stack([np.interp(s_of, s_path, column) for column in q_path.T])
    v = np.gradient(q_of, fine, axis=0)
    a = np.gradient(v, fine, axis=0)
    torque = line.robot.chain.torques(q_of, v, a) - line.robot.chain.torques(
        q_of, 0.0 * v, 0.0 * a
    )
    t_end = float(np.sqrt(np.abs(torque / line.robot.limits.torque).max()))
    if np.isfinite(line.robot.limits.velocity).all():
        t_end = max(t_end, float(np.abs(v / line.robot.limits.velocity).max()))
    points = [np.interp(greville, fine, own) for own in (s_of, q_of[:, free])]
    for column in points:
        column[:DEGREE] = column[0]
        column[-DEGREE:] = column[-1]
    moments = [
        np.column_stack([np.interp(at, fine, column) for column in own.T])[:, others]
        / t_end**order
        for order, own in enumerate((q_of, v, a))
    ]
    return np.concatenate([[t_end], *points, *(own.ravel() for own in moments)])


def _sample(
    joint_map: JointMap,
    knots: np.ndarray,
    points: np.ndarray,
    t_end: float,
    t: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow the curves with the closed form."""
    first, values = local_basis(knots, DEGREE, t / t_end)
    control = points[:, first[:, None] + np.arange(DEGREE + 1)]
    curves = [
        np.einsum("kw,ckw->kc", own, control) / t_end**order
        for order, own in enumerate(values)
    ]
    state = joint_map.state(*curves, t=t)
    return state.q, state.qdot, state.qddot
