"""Motions for controllers: start postures, and programs of positions run by a simulation of its own."""

import numpy as np

RAIL_START = [0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]
SEVEN_START = [0.1, 0.5, 0.2, -1.2, 0.1, 0.8, 0.3]
BLEND = 0.25


def simulate(times, nodes, rests, t):
    """Run lines of constant velocity with linear changes of it, by integrating the velocity."""
    h = np.diff(times)
    ramps = BLEND * h
    lines = np.diff(nodes, axis=0)
    constant = h - 0.5 * ramps * rests[:-1] - 0.5 * ramps * rests[1:]
    speeds = lines / constant[:, None]
    knots = []
    for k in range(len(times)):
        before = speeds[k - 1] if k else 0.0 * speeds[0]
        after = speeds[k] if k < len(h) else 0.0 * speeds[0]
        if rests[k]:
            if k:
                knots += [(times[k] - ramps[k - 1], before), (times[k], 0.0 * before)]
            if k < len(h):
                knots += [(times[k], 0.0 * after), (times[k] + ramps[k], after)]
        else:
            half = BLEND * min(h[k - 1], h[k])
            knots += [(times[k] - half, before), (times[k] + half, after)]
    knot_times = np.array([time for time, _ in knots])
    rates = np.array([rate for _, rate in knots])
    velocity = np.column_stack([np.interp(t, knot_times, column) for column in rates.T])
    steps = 0.5 * np.diff(t)[:, None] * (velocity[1:] + velocity[:-1])
    return nodes[0] + np.vstack([np.zeros_like(nodes[:1]), np.cumsum(steps, axis=0)])


def bend_of(start, center, places):
    """Distances, m, of places from a line along y to the height of an arc's center, then the arc, and lengths there."""
    length = center[1] - start[1]
    along = (places[:, 1] - start[1]).clip(0.0, length)
    from_line = np.linalg.norm(
        places - start - np.outer(along, [0.0, 1.0, 0.0]), axis=1
    )
    radius = center[0] - start[0]
    x, y = (places - center)[:, :2].T
    angle = np.arctan2(y, -x).clip(0.0, None)
    on_arc = radius * np.column_stack([-np.cos(angle), np.sin(angle), 0.0 * angle])
    from_arc = np.linalg.norm(places - center - on_arc, axis=1)
    is_line = from_line < from_arc
    away = np.where(is_line, from_line, from_arc)
    return away, np.where(is_line, along, length + radius * angle)


def deviation(motion, center, program, *, is_linear):
    """Largest deviations in place, m or rad, and in time, s, of a program from the motion of the fixture `bend`.

    `program` has times, postures, and whether the arm rests there.
    """
    times, nodes, rests = program
    t = np.linspace(0.0, times[-1], 30_001)
    tool = motion.robot.tool_placements
    if is_linear:
        places = simulate(times, tool(nodes)[0], rests, t)
        angle = np.zeros(1)
    else:
        places, rotations = tool(simulate(times, nodes, rests, t))
        first = tool(nodes[:1])[1][0]
        cosine = (np.trace(first.T @ rotations, axis1=1, axis2=2) - 1.0) / 2.0
        angle = np.arccos(cosine.clip(-1.0, 1.0))
    dense = np.linspace(0.0, motion.t_end, 100_001)
    planned = tool(motion.position(dense))[0]
    away, length = bend_of(planned[0], center, places)
    _, lengths = bend_of(planned[0], center, planned)
    lengths = np.maximum.accumulate(lengths)
    # Where the motion dwells, one place has many times.
    first = dense[np.searchsorted(lengths, length - 1e-7).clip(max=100_000)]
    last = dense[np.searchsorted(lengths, length + 1e-7).clip(max=100_000)]
    late = np.maximum(first - t, t - last)
    speeds = np.gradient(lengths, dense)
    is_fast = np.interp(t, dense, speeds) > 1e-3 * lengths[-1] / motion.t_end
    return max(away.max(), angle.max()), late[is_fast].max()
