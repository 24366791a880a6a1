"""Plans that start from a known motion: of the same task, with other limits, another path, other coordinates."""

import pytest

import brachis
from brachis import Line
from brachis.search.given_motion import GIVEN
from brachis.task import task_with

TASK = task_with(
    robot={"urdf": str(brachis.robots.path_of("scara3"))},
    path=Line(by=[0.0, 0.6]),
    start=[0.5236, -2.0944, 2.0944],
    task_space=["x", "y"],
    intervals=8,
    effort="single",
    least_motion=False,
)


@pytest.fixture(scope="module")
def known_motion():
    return brachis.plan(TASK)


CHANGES = {
    "the same": {},
    "limits": {"limits": {"torque": 12.0}},
    "path": {"path": Line(by=[0.05, 0.55])},
    "start": {"start": [0.5736, -2.0944, 2.0744]},
    "intervals": {"intervals": 14},
    "robot": {"payload": {"mass": 0.3}},
    "joints": {"redundant_joints": ["j2"]},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_known_motion_takes_the_place_of_the_search(known_motion, name):
    told = []
    result = brachis.plan(
        known_motion.task,
        start_from=known_motion,
        listener=told.append,
        **CHANGES[name],
    )
    assert result.verified
    assert result.not_completed == ()
    assert [candidate.origin for candidate in result.candidates] == [GIVEN]
    assert not any("lattice" in text for text in told), "nothing was searched for"
    if not CHANGES[name]:
        assert result.t_end <= 1.0005 * known_motion.t_end


def test_saved_motions_will_do(known_motion, tmp_path):
    known_motion.save(tmp_path / "result.npz")
    for motion in (known_motion.trajectory, tmp_path / "result.npz"):
        assert brachis.plan(TASK, start_from=motion).candidate.origin == GIVEN


@pytest.mark.parametrize("space", ["pose_with_yaw", "joints"])
def test_of_other_task_spaces(space):
    if space == "joints":
        line = {
            "task_space": "joints",
            "path": Line(by=[0.3, 0.2, -0.4]),
            "redundant_joints": "auto",
        }
    else:
        line = {"task_space": ["x", "y", "yaw"], "path": Line(by=[0.0, 0.3, 0.1])}
    first = brachis.plan(TASK, **line)
    again = brachis.plan(TASK, **line, limits={"torque": 12.0}, start_from=first)
    assert again.candidate.origin == GIVEN
    assert again.verified
    assert again.t_end < first.t_end


@pytest.mark.parametrize(
    "changes, reason",
    [
        ({"path": Line(by=[-3.0, -0.1])}, "cannot be brought onto the path"),
        ({"path": Line(by=[0.0, 0.6]), "redundant_joints": ["j1"]}, ""),
    ],
)
def test_what_cannot_be_used_is_said_and_the_search_goes_on(
    known_motion, changes, reason
):
    result = brachis.plan(TASK, start_from=known_motion, **changes)
    assert result.verified
    assert (
        (reason in " ".join(result.not_completed))
        if reason
        else result.not_completed == ()
    )


def test_a_motion_of_another_robot_has_no_use(known_motion):
    gantry = brachis.plan(
        "gantry2",
        path=Line(by=0.2),
        start=[0.0, 0.0],
        task_space=["x"],
        intervals=8,
        effort="single",
        start_from=known_motion,
    )
    assert "its joints are j1, j2, j3" in gantry.not_completed[0]
    assert "the usual search was made" in gantry.not_completed[0]
    assert gantry.verified
