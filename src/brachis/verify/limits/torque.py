"""tau_min <= tau <= tau_max, with limits below and above zero.

|dtau/dt| <= rate_max.

What drives bear: power, torque that falls with speed, root-mean-square torque.
"""

from __future__ import annotations

import numpy as np

from brachis.verify.limits.protocol import Given, Worst, worst_between
from brachis.verify.mechanics import torque_rates
from brachis.verify.motion import States


def worst_torque(given: Given) -> Worst | None:
    """Find the largest torque ratio, at the states and between them."""
    lower, upper = given.robot.limits.torque_lower, given.robot.limits.torque_upper
    if not np.isfinite(upper).any():
        return None
    return worst_between(
        given,
        lambda states: np.maximum(states.tau / upper, states.tau / lower),
        given.robot.joint_names,
    )


def worst_torque_rate(given: Given) -> Worst | None:
    """Find the largest ratio of a torque's rate, at the states and between them."""
    limit, robot = given.robot.limits.torque_rate, given.robot
    if not np.isfinite(limit).any():
        return None

    def ratios(states: States) -> np.ndarray:
        return (
            np.abs(
                torque_rates(robot, states.q, states.qdot, states.qddot, states.qdddot)
            )
            / limit
        )

    return worst_between(given, ratios, robot.joint_names)


_NO_STEP = 1e-8
"""Steps in a piece, as parts of it, that are too short to count."""


def worst_power(given: Given) -> Worst | None:
    """Find the largest ratio of a joint's power, at the states and between them."""
    limit = given.robot.limits.power
    if not np.isfinite(limit).any():
        return None
    names = given.robot.joint_names
    return worst_between(
        given, lambda states: np.abs(states.tau * states.qdot) / limit, names
    )


def worst_total_power(given: Given) -> Worst | None:
    """Find the largest ratio of the sum of all joints' powers."""
    limit = given.robot.limits.total_power
    if not np.isfinite(limit):
        return None

    def ratios(states: States) -> np.ndarray:
        return np.abs(np.einsum("ki,ki->k", states.tau, states.qdot))[:, None] / limit

    return worst_between(given, ratios, ("all joints",))


def worst_torque_at_speed(given: Given) -> Worst | None:
    """Find the torque that is furthest beyond what its joint's curve allows at its speed.

    The ratio is 1 on the curve; differences count as parts of the torque at rest.
    """
    robot = given.robot
    curved = [joint for joint, curve in enumerate(robot.limits.torque_speed) if curve]
    if not curved:
        return None

    def ratios(states: States) -> np.ndarray:
        found = np.empty((len(states.t), len(curved)))
        for column, joint in enumerate(curved):
            speed, torque = np.array(robot.limits.torque_speed[joint]).T
            moving = np.abs(states.qdot[:, joint])
            last = (torque[-1] - torque[-2]) / (speed[-1] - speed[-2])
            beyond = last * np.maximum(moving - speed[-1], 0.0)
            allowed = np.maximum(np.interp(moving, speed, torque) + beyond, 0.0)
            found[:, column] = (
                1.0 + (np.abs(states.tau[:, joint]) - allowed) / torque[0]
            )
        return found

    return worst_between(given, ratios, [robot.joint_names[joint] for joint in curved])


def worst_rms_torque(given: Given) -> Worst | None:
    """Find the largest ratio of a root mean square of torques, by Simpson's rule between all states of each piece."""
    limit, states = given.robot.limits.rms_torque, given.states
    if not np.isfinite(limit).any():
        return None
    steps = np.flatnonzero(
        (np.diff(states.piece) == 0) & (np.diff(states.u) > _NO_STEP)
    )
    middle = 0.5 * (states.u[steps] + states.u[steps + 1])
    between = States.at(given.pieces, given.robot, states.piece[steps], middle)
    lengths = states.t[steps + 1] - states.t[steps]
    squares = (
        states.tau[steps] ** 2 + 4.0 * between.tau**2 + states.tau[steps + 1] ** 2
    ) / 6.0
    mean = lengths @ squares / lengths.sum()
    ratios = np.sqrt(mean) / limit
    joint = int(np.argmax(ratios))
    return Worst(
        float(ratios[joint]), given.robot.joint_names[joint], float(states.t[-1])
    )
