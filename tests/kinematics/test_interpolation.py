"""Nodes and quintic pieces against the closed form at other times."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

from brachis.errors import UnreachableError
from brachis.kinematics import interpolate
from brachis.robot import Robot
from brachis.trajectory.pieces import piece_coefficients
from support.chains import planar_robot
from support.motions import Sway, joint_map


def pieces(nodes):
    """SciPy's quintic pieces from the nodes' values and derivatives."""
    return BPoly.from_derivatives(
        nodes.times, np.stack([nodes.q, nodes.qdot, nodes.qddot], axis=1)
    )


@pytest.mark.parametrize(
    "pattern, start, redundant",
    [
        ("RRR", [0.4, 1.0, 0.5], ["j2"]),
        ("RPR", [0.4, 0.2, 0.9], ["j1"]),
        ("RRRR", [0.4, 0.8, 0.7, 0.5], ["j1", "j4"]),
    ],
)
def test_pieces_agree_with_the_closed_form_at_random_times(pattern, start, redundant):
    chain = joint_map(
        planar_robot(pattern),
        ["x", "y"],
        [{"line": {"by": [-0.15, 0.1]}}],
        start,
        redundant,
    )
    motion = Sway(chain)
    nodes = interpolate(chain, motion, np.linspace(0.0, 1.0, 6), jumps=False)
    t = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 500))
    state, curve = chain.state(*motion(t)), pieces(nodes)
    assert np.abs(curve(t) - state.q).max() <= 1e-11
    assert np.abs(curve(t, nu=1) - state.qdot).max() < 1e-8
    assert np.abs(curve(t, nu=2) - state.qddot).max() < 1e-5 * np.abs(state.qddot).max()
    assert (
        np.abs(curve(t, nu=3) - state.qdddot).max() < 1e-5 * np.abs(state.qdddot).max()
    )


@pytest.mark.parametrize("gap", [1e-4, 2e-5])
def test_the_jerk_of_short_pieces_is_that_of_the_closed_form(gap):
    """Positions that are 1e-15 rad off would be a jerk of 60 rad/s^3 over 1e-5 s."""
    chain = joint_map(
        planar_robot("RRR"),
        ["x", "y"],
        [{"line": {"by": [-0.15, 0.1]}}],
        [0.4, 1.0, 0.5],
        ["j2"],
    )
    motion = Sway(chain)
    breaks = np.union1d(np.linspace(0.0, 1.0, 6), 0.5 + gap * np.arange(8))
    nodes = interpolate(chain, motion, breaks, jumps=False)
    _, jerk = piece_coefficients(
        nodes.times, nodes.q, nodes.qdot, nodes.qddot, nodes.qddot_before
    )
    short = np.diff(nodes.times) <= gap
    assert short.sum() >= 14
    state = chain.state(*motion(nodes.times))
    for off in (jerk[0] - state.qdddot[:-1], jerk[2] - state.qdddot[1:]):
        assert np.abs(off[short]).max() < 5e-5 * np.abs(state.qdddot).max()
    assert np.abs(nodes.q - state.q).max() < 1e-11


def test_motion_that_leaves_the_branch_between_the_breaks(scara_urdf):
    robot = Robot.from_urdf(scara_urdf)
    chain = joint_map(
        robot, ["x", "y"], [{"line": {"by": [0.0, 0.1]}}], [0.2, 1.0, 0.6], ["j3"]
    )

    def excursion(t):
        s = np.sin(4.0 * np.pi * t) ** 2 * 60.0  # far off at all times but the quarters
        y = np.stack([s, np.full_like(t, 0.6)], axis=1)
        return y, 0.0 * y, 0.0 * y, 0.0 * y

    with pytest.raises(UnreachableError):
        interpolate(chain, excursion, np.array([0.0, 1.0]), jumps=False)
