"""The smallest distance on a whole motion: proven between the instants that are looked at, and refused if too small."""

from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import PathError
from brachis.robot.from_task import robot_for
from brachis.scene import scene_of
from brachis.scene.chain import Chain

START = [np.pi / 6, -2 * np.pi / 3, 2 * np.pi / 3]


def planned(scene, mode="avoid", **collisions):
    return brachis.plan(
        "scara3",
        path=[brachis.Line(by=[0.0, 1.0])],
        start=START,
        task_space=["x", "y"],
        gravity=[0, 0, 0],
        limits={"torque": 10},
        redundant_joints=["j1"],
        intervals=12,
        effort="single",
        least_motion=False,
        scene=scene,
        collisions={"mode": mode, **collisions},
    )


def check_of(result):
    checks = {check.name: check for check in result.verification.checks}
    return checks.get("clearance ratio")


def dense(result, count=5_000):
    """Smallest distance on a fine grid, m."""
    trajectory = result.trajectory
    robot = robot_for(None, trajectory.task.robot)
    found = scene_of(robot, trajectory.task)
    q = trajectory.position(np.linspace(0.0, trajectory.t_end, count))
    return found.find_close(Chain.of(robot.model).place(q), 1.0).distance.min()


@pytest.fixture(scope="module")
def elbow():
    """Where the elbow of the motion without obstacles is at its middle, (3,) m."""
    result = planned([])
    q = result.trajectory.position(0.5 * result.t_end)
    return (
        next(iter(result.trajectory.robot.place_joints(q[None])))
        .oMi[2]
        .translation.copy()
    )


def post(at, radius=0.03, **more):
    shape = {"cylinder": {"radius": radius, "length": 1.0}}
    return [{"name": "post", **shape, "position": list(at), **more}]


def test_a_motion_through_a_thin_pin_is_an_error(elbow):
    """It is so thin that the links pass it between the instants of any grid."""
    result = planned(post(elbow, 1e-4), mode="check", clearance=0.0)
    check = check_of(result)
    assert not result.verified
    assert not check.passed
    assert "post" in check.subject
    # No other plan is tried: none of them would keep clear.
    assert len(result.candidates) == 1
    assert dense(result) < 0.0


def test_the_scene_s_nearest_body_is_named_beside_a_closer_pair_of_links(elbow):
    guard = {"name": "guard", "sphere": 0.06, "link": "link3", "position": [0, 0, 0.1]}
    bodies = [*post(elbow + np.array([0.05, 0.05, 0.0]), 0.01), guard]
    remark = check_of(planned(bodies, mode="check", clearance=0.0)).remark
    assert "to a body of the scene 23.3" in remark
    assert "(link2 and post)" in remark


def test_a_motion_goes_round_a_post_and_keeps_the_clearance():
    at = [1.2, -0.45, 0.0]
    result = planned(post(at))
    check = check_of(result)
    assert result.verified
    assert 0.98 < check.value <= check.allowed
    least = dense(result)
    assert 0.01 - 1e-5 < least < 0.012
    assert f"smallest distance {1e3 * least:.2f}" in check.remark
    assert "post" in check.subject
    ahead = planned(post(at), mode="off")
    assert ahead.verified
    assert check_of(ahead) is None
    assert ahead.t_end < 0.99 * result.t_end


def test_where_nothing_is_free_the_error_says_what_is_in_the_way_and_where():
    with pytest.raises(PathError, match="clearance limit of link2 and post") as caught:
        planned(post([1.03, 0.0, 0.0]))
    begin, end = caught.value.s_interval
    assert 0.4 < begin < 0.7
    assert end == 1.0


def test_what_is_proven_is_never_more_than_what_is_there(elbow):
    for shift in (0.1, 0.2, 0.3):
        result = planned(post(elbow + np.array([shift, 0.0, 0.0])), mode="check")
        check = check_of(result)
        least = dense(result)
        if least < 0.06:
            assert check.value == pytest.approx(1.0 + (0.01 - least) / 0.1, abs=2e-4)
        else:
            assert "nothing is closer than 60 mm" in check.remark


def test_bodies_on_a_link_move_with_it():
    held = post([0.0, 0.0, 0.0], 0.05, link="tool")
    wall = {"name": "wall", "box": [0.02, 3.0, 3.0], "position": [2.0, 0.0, 0.0]}
    result = planned(
        [*held, wall],
        mode="check",
        disable=[["link2", "wall"], ["link1", "wall"], ["link3", "wall"]],
    )
    # The tool moves along x = sqrt(3).
    assert result.verified
    assert dense(result) == pytest.approx(2.0 - 0.01 - np.sqrt(3.0) - 0.05, abs=1e-6)


def test_a_saved_motion_is_verified_with_its_scene(elbow, tmp_path):
    result = planned(post(elbow, 1e-4), mode="check", clearance=0.0)
    file = Path(tmp_path / "motion.npz")
    result.save(file)
    again = brachis.verify_trajectory(file)
    assert not again.passed
    assert [check.name for check in again.checks if not check.passed] == [
        "clearance ratio"
    ]
