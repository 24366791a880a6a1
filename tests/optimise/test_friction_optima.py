"""Slides that rub, and drives with rotors: shortest times known by hand.

A mass m is pushed over a distance L by a force of at most F, with switch times t1 (pushing) and t2 (braking):

    viscous b     T = m / b, t1 - t2 = b L / F (from m dv = 0), and speed and way from the exponentials below
    Coulomb c     accelerations (F - c) / m and (F + c) / m: V^2 = 2 L a1 a2 / (a1 + a2), t = V (1 / a1 + 1 / a2)
    armature      bang-bang of the mass m + J_rotor ratio^2
"""

import numpy as np
import pytest
from scipy.optimize import brentq

import brachis
from brachis.verify import verify_trajectory
from support.checks import failed_checks
from support.slides import X, plan_slides, slides

MASS, FORCE, LENGTH = 4.0, 50.0, 1.2
VISCOUS, COULOMB = 12.0, 20.0
EVEN, FEW = {"intervals": 80}, {"intervals": 10}
FREE = {"intervals": 16, "knots": "free", "shortest_interval": 0.02}
"""Where the slide comes to rest its friction ends, and with it much of what brakes: the last knots lie close."""
DYNAMICS = "<dynamics damping='{damping}' friction='{friction}'/>"


def slide(damping=0.0, friction=0.0):
    extra = DYNAMICS.format(damping=damping, friction=friction)
    return slides([X], [FORCE], MASS, extra)


def plan(robot, spline=EVEN, **settings):
    return plan_slides(robot, ["x"], [LENGTH], settings=settings, spline=spline)


def viscous_time():
    steady, scale = FORCE / VISCOUS, MASS / VISCOUS

    def beyond(pushing):
        braking = pushing - VISCOUS * LENGTH / FORCE
        speed = steady * (1.0 - np.exp(-pushing / scale))
        there = steady * (pushing - scale * (1.0 - np.exp(-pushing / scale)))
        back = (speed + steady) * scale * (
            1.0 - np.exp(-braking / scale)
        ) - steady * braking
        return there + back - LENGTH

    pushing = brentq(beyond, VISCOUS * LENGTH / FORCE, 10.0)
    return 2.0 * pushing - VISCOUS * LENGTH / FORCE


def coulomb_time():
    pushing, braking = (FORCE - COULOMB) / MASS, (FORCE + COULOMB) / MASS
    speed = np.sqrt(2.0 * LENGTH * pushing * braking / (pushing + braking))
    return float(speed / pushing + speed / braking)


FRICTIONLESS = 2.0 * np.sqrt(MASS * LENGTH / FORCE)
HEAVY = 2.0 * np.sqrt((MASS + 4.0) * LENGTH / FORCE)


@pytest.mark.parametrize(
    "robot, friction, spline, expected",
    [
        (slide(damping=VISCOUS), {}, EVEN, viscous_time()),
        (slide(), {"viscous": VISCOUS}, EVEN, viscous_time()),
        (slide(friction=COULOMB), {"coulomb_velocity": 1e-3}, FREE, coulomb_time()),
        (
            slide(VISCOUS, COULOMB),
            {"viscous": None, "coulomb": None},
            EVEN,
            FRICTIONLESS,
        ),
        (slide(), {"rotor_inertia": 1e-4, "gear_ratio": 200.0}, EVEN, HEAVY),
        (slide(), {"armature": 4.0}, EVEN, HEAVY),
    ],
    ids=[
        "viscous of the URDF",
        "viscous",
        "Coulomb of the URDF",
        "switched off",
        "rotor",
        "armature",
    ],
)
def test_slides_with_friction_reach_the_known_optimum(
    robot, friction, spline, expected
):
    result = plan(robot, spline, friction=friction)
    assert result.verified
    assert expected * (1.0 - 1e-4) < result.t_end < 1.001 * expected


@pytest.mark.parametrize(
    "robot",
    [slide(damping=VISCOUS), slide(friction=COULOMB)],
    ids=["viscous", "Coulomb"],
)
def test_a_motion_without_friction_exceeds_the_torque_of_a_drive_that_rubs(robot):
    free = plan(robot, FEW, friction={"viscous": None, "coulomb": None})
    assert free.t_end < 0.99 * plan(robot, FEW).t_end
    rubbing = brachis.Robot.from_urdf(
        "slide", urdf_text=robot.urdf, gravity=[0, 0, 0], tool_frame="tool"
    )
    verification = verify_trajectory(free.trajectory, robot=rubbing)
    assert failed_checks(verification) == ["torque ratio"]
