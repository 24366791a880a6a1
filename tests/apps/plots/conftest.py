import numpy as np
import pytest

import brachis
from support import motions


@pytest.fixture(scope="session")
def spatial_trajectory(line_trajectory):
    """An arm on a rail from one posture to another within one polynomial piece."""
    q = np.array(
        [[0.0, 0.3, 0.4, 0.8, 0.2, 0.9, 0.0], [0.9, -0.6, 0.6, 0.5, 0.2, 0.9, 1.0]]
    )
    return motions.motion_between(
        line_trajectory,
        brachis.robots.tx90l_rail,
        q,
        task_space=("x", "y", "z"),
        redundant_joints=("rail",),
    )


@pytest.fixture(scope="session")
def with_limits():
    """A trajectory's copy whose robot has other limits."""
    return motions.with_limits
