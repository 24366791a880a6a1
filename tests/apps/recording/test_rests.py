"""A recorded motion that waits is imported in phases: its path stops there, and may turn off."""

import numpy as np
import pytest

import brachis
from brachis import export
from brachis.errors import PathError
from brachis.robot import Robot
from support.checks import failing_checks
from support.gantry import DWELL, SPLINES, gantry_motion, gantry_urdf


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    urdf = tmp_path_factory.mktemp("gantry") / "robot.urdf"
    urdf.write_text(gantry_urdf())
    return Robot.from_urdf(urdf)


def record_and_import(motion, robot, folder, dt):
    export.write(motion, folder / "recorded.csv", dt=dt)
    return brachis.import_motion(folder / "recorded.csv", robot, task_space=["x", "z"])


@pytest.mark.parametrize("dt", [0.01, 0.007])
def test_a_wait_at_a_corner(robot, tmp_path, dt):
    """Rows of 7 ms miss both ends of the wait."""
    motion = gantry_motion()
    again = record_and_import(motion, robot, tmp_path, dt)
    assert [phase.kind for phase in again.phases] == ["move", "dwell", "move"]
    wait = again.phases[1]
    assert wait.s_begin == pytest.approx(0.4, abs=1e-6)
    assert wait.begin == pytest.approx(1.0, abs=dt)
    assert wait.duration == pytest.approx(DWELL, abs=2.0 * dt)
    (stop,) = [segment for segment in again.task.path if segment.stop]
    assert stop.dwell == wait.duration
    t = np.linspace(0.0, motion.t_end, 200)
    np.testing.assert_allclose(again.position(t), motion.position(t), atol=1e-4)
    assert failing_checks(again) == set()


def test_it_is_saved_with_its_phases(robot, tmp_path):
    again = record_and_import(gantry_motion(), robot, tmp_path, 0.01)
    again.save(tmp_path / "recorded.npz")
    assert brachis.Trajectory.load(tmp_path / "recorded.npz").phases == again.phases


def test_a_corner_without_a_wait_is_an_error(robot, tmp_path):
    motion = gantry_motion((SPLINES[0], *SPLINES[2:]))
    with pytest.raises(PathError, match="stops for fewer than five rows"):
        record_and_import(motion, robot, tmp_path, 0.01)
