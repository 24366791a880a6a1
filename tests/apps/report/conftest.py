"""Short motions of a planar arm and of an arm on a rail, and a browser to look at their reports."""

import base64
import dataclasses
import json
import re

import numpy as np
import pytest

import brachis
from brachis.apps.report import make_report
from support.effort import QUICK


@pytest.fixture(scope="session")
def planar():
    return brachis.plan(brachis.examples.scara_line, **QUICK, intervals=8)


@pytest.fixture(scope="session")
def rail():
    return brachis.plan(brachis.examples.tx90l_rail_line, **QUICK, intervals=8)


@pytest.fixture(scope="session")
def planar_page(planar):
    return make_report(planar)


@pytest.fixture(scope="session")
def rail_page(rail):
    return make_report(rail)


@pytest.fixture(scope="session")
def weaker(rail):
    """The motion on drives that are weaker by a tenth."""
    trajectory = rail.trajectory
    weak = trajectory.robot.limits.with_magnitudes(
        torque=0.9 * trajectory.robot.limits.torque
    )
    return dataclasses.replace(
        trajectory, robot=dataclasses.replace(trajectory.robot, limits=weak)
    )


@pytest.fixture(scope="session")
def weaker_page(weaker):
    return make_report(weaker, title="<script>weaker</script>")


def data_of(page):
    """What the page's programs read."""
    return json.loads(re.search(r'id="data">(.*?)</script>', page.html, re.DOTALL)[1])


def floats(array):
    values = np.frombuffer(base64.b64decode(array["bdata"]), dtype=array["dtype"])
    return (
        values.reshape([int(n) for n in array["shape"].split(",")])
        if "shape" in array
        else values
    )
