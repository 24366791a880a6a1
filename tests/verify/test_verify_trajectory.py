"""Every check lets the planned motion pass and finds the fault that it is there for."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.errors import InputError
from brachis.robot import Robot
from brachis.task import Posture
from brachis.trajectory import Pieces
from brachis.verify import VerifyOptions, verify_trajectory
from support.checks import check_of, failed_checks, failing_checks, with_entry
from support.motions import with_limits

MIDDLE = 60


def faster(trajectory, factor):
    t = trajectory
    return replace(
        t,
        times=t.times / factor,
        phase_ends=t.phase_ends / factor,
        qdot=t.qdot * factor,
        qddot=t.qddot * factor**2,
        qddot_before=t.qddot_before * factor**2,
    )


def ended_elsewhere(trajectory, end="end", node=-1):
    """The trajectory of a task that begins or ends in a posture beside its own."""
    posture = Posture(joints=tuple(trajectory.q[node] + [0.0, 0.0, 1e-6]))
    task = trajectory.task.model_copy(update={end: posture})
    return replace(trajectory, task=task)


def backwards(trajectory):
    points = trajectory.control_points[0]
    step = points[11] - points[10] + 0.05
    return with_entry(trajectory, "control_points", (0, [10, 11]), [step, -step])


def torn(trajectory, row, by):
    """The trajectory with one Bernstein coefficient of one piece moved, which its nodes cannot express."""
    torn = replace(trajectory)
    c = torn.pieces.c.copy()
    c[row, MIDDLE, 0] += by
    vars(torn)["pieces"] = Pieces(c, torn.times)
    return torn


def shift(name, place, by):
    return lambda t: with_entry(t, name, place, by)


FAULTS = {
    "off the path": ("path error", shift("q", (MIDDLE, 0), 1e-8)),
    "too fast": ("torque ratio", lambda t: faster(t, 1.001)),
    "backwards": ("ds/dt below zero", backwards),
    "short of the path's end": (
        "s at the ends",
        shift("control_points", (0, -1), -1e-6),
    ),
    "not from the path's beginning": (
        "s at the ends",
        shift("control_points", (0, 0), 1e-6),
    ),
    "starts elsewhere": ("start posture", lambda t: ended_elsewhere(t, "start", 0)),
    "ends elsewhere": ("end posture", ended_elsewhere),
    "moving at the start": ("start velocity", shift("qdot", (0, 1), 1e-7)),
    "moving at the end": ("end velocity", shift("qdot", (-1, 1), 1e-7)),
    "accelerating at the start": ("start acceleration", shift("qddot", (0, 1), 1e-5)),
    "accelerating at the end": (
        "end acceleration",
        shift("qddot_before", (-1, 1), 1e-5),
    ),
    "another spline": ("redundant joints' splines", shift("control_points", 1, 0.3)),
    "one control point": (
        "redundant joints' splines",
        shift("control_points", (1, 9), 1e-6),
    ),
    "position jumps": ("position jump", lambda t: torn(t, 5, 1e-4)),
    "velocity jumps": ("velocity jump", lambda t: torn(t, 4, 1e-6)),
    "acceleration jumps": (
        "acceleration jump",
        shift("qddot_before", (MIDDLE, 0), 1e-3),
    ),
    "torque jumps": ("torque jump", shift("qddot_before", (MIDDLE, 0), 1e-6)),
}
ALONE = {
    "off the path",
    "too fast",
    "ends elsewhere",
    "accelerating at the end",
    "another spline",
    "one control point",
    "torque jumps",
}
"""Faults that no other check may report."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_verification_finds_each_fault(fault, planned):
    name, tamper = FAULTS[fault]
    assert failing_checks(planned) == set()
    verification = verify_trajectory(tamper(planned))
    failed = failed_checks(verification)
    assert name in failed
    assert not verification.passed
    if fault in ALONE:
        assert failed == [name]


def test_every_check_has_its_fault(planned):
    limits = {
        f"{kind} ratio" for kind in ("velocity", "acceleration", "position")
    }  # see below
    names = [check.name for check in verify_trajectory(ended_elsewhere(planned)).checks]
    assert sorted(names) == sorted({name for name, _ in FAULTS.values()} | limits)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "kind, quantity",
    [("velocity", "qdot"), ("acceleration", "qddot"), ("torque", "tau")],
)
def test_limit(kind, quantity, sign, planned):
    joint = 1
    values = np.abs(getattr(planned.sample(planned.t_end / 5000), quantity)[:, joint])
    limit = np.array(getattr(planned.robot.limits, kind))
    limit[joint] = values.max() / 1.001
    mirrored = mirror(planned) if sign < 0 else planned
    verification = verify_trajectory(with_limits(mirrored, **{kind: limit}))
    check = check_of(verification, f"{kind} ratio")
    assert not check.passed
    assert check.subject == "j2"
    assert check.value == pytest.approx(1.001, abs=1e-4)
    assert verification.worst_ratio == check.value
    assert check.time == pytest.approx(
        np.argmax(values) / 5000 * planned.t_end, abs=0.02
    )


def mirror(trajectory):
    """The motion backwards in space; it leaves the path, and its torques change sign without gravity."""
    t = trajectory
    return replace(
        t, q=-t.q, qdot=-t.qdot, qddot=-t.qddot, qddot_before=-t.qddot_before
    )


def check_in_range(trajectory, lower, upper):
    limited = with_limits(trajectory, position_lower=lower, position_upper=upper)
    return check_of(verify_trajectory(limited), "position ratio")


def test_positions_are_told_by_their_place_in_the_range(planned):
    q = planned.sample(planned.t_end / 5000).q
    middle, half = q[0], 1.25 * np.abs(q - q[0]).max(axis=0)
    check = check_in_range(planned, middle - half, middle + half)
    assert check.passed
    assert check.value == pytest.approx(0.8, abs=1e-4)
    far = check_in_range(planned, np.full(3, -np.inf), np.full(3, 50.0))
    assert far.value == 0.0


def test_nothing_passes_that_is_no_number(planned):
    failed = failing_checks(with_entry(planned, "control_points", (0, 8), np.nan))
    assert {"ds/dt below zero", "path error"} <= failed
    failed = failing_checks(with_entry(planned, "q", (MIDDLE, 0), np.nan))
    ratios = {"torque ratio", "position ratio"}
    assert {"path error", "position jump", *ratios} <= failed


def test_tolerances_are_options(planned):
    moved = with_entry(planned, "control_points", 1, 0.3)
    assert not failing_checks(moved, options=VerifyOptions(spline_tolerance=0.31))
    strict = VerifyOptions(ratio_tolerance=-0.5)
    assert failing_checks(planned, options=strict) == {"torque ratio"}


@pytest.mark.parametrize(
    "old, new", [('"j2"', '"elbow"'), ('type="continuous"', 'type="fixed"')]
)
def test_robot_of_other_joints_is_an_error(old, new, planned):
    place = planned.urdf.index(old)
    text = planned.urdf[:place] + planned.urdf[place:].replace(old, new, 1)
    robot = Robot.from_urdf("other", urdf_text=text)
    with pytest.raises(
        InputError, match="joints of the robot are not those of the trajectory"
    ) as caught:
        verify_trajectory(planned, robot=robot)
    assert caught.value.found == ", ".join(robot.joint_names)
    assert caught.value.allowed == "j1, j2, j3"


def test_words_and_table_state_the_same_allowed_value(planned):
    verification = verify_trajectory(planned)
    for check in verification.checks:
        _, allowed, _ = check.figures(degrees=False)
        assert f"<= {allowed}" in verification.summary()[check.name]
    assert "<= 1.0001, j" in verification.summary()["torque ratio"]


def test_robot_without_redundancy_has_no_spline_check(planned):
    plain = replace(
        planned, redundant_joints=(), control_points=planned.control_points[:1]
    )
    verification = verify_trajectory(plain)
    assert verification.passed
    names = {check.name for check in verification.checks}
    assert "redundant joints' splines" not in names
