"""What hangs on a robot cannot be changed by accident."""

from dataclasses import fields

import numpy as np
import pytest

from brachis.robot import Friction, Limits, bind
from support.chains import planar_robot
from support.spatial import rail_arm


def arrays(kind):
    return [
        field.name for field in fields(kind) if field.type in (np.ndarray, "np.ndarray")
    ]


@pytest.mark.parametrize(
    "robot",
    [planar_robot("RPC"), bind(rail_arm(), "pose_free_roll")[0]],
    ids=["plain", "rolling"],
)
def test_arrays_of_a_robot_are_read_only(robot):
    for part in (robot.limits, robot.friction):
        assert len(arrays(part)) >= 4
        for name in arrays(part):
            with pytest.raises(ValueError, match="read-only"):
                getattr(part, name)[0] = 1.0


@pytest.mark.parametrize("kind", [Limits, Friction])
def test_later_changes_of_the_given_arrays_do_not_count(kind):
    given = np.ones(3)
    made = kind(*(given for _ in fields(kind)))
    given[0] = 5.0
    assert all(getattr(made, name)[0] == 1.0 for name in arrays(kind))
