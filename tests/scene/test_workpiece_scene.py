"""Solids of a cell with a positioner: where they are in the world, by Pinocchio, and their distances."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.limits import Moments
from brachis.limits.clearance import build_clearance
from brachis.robot.from_task import robot_for
from brachis.scene import UNIT, scene_of
from brachis.scene.chain import Chain
from brachis.verify.mechanics import joint_placements

MOUNTING = {"xyz": [0.1, 0.2, 0.3], "rpy_deg": [5.0, 6.0, 7.0]}
BODIES = yaml.safe_load("""
- {name: post, box: [0.1, 0.1, 1.5], position: [0.5, 0.6, 0.3]}
- {name: floor, half_space: {normal: [0, 0, 1], offset: -0.4}}
- {name: seam guard, sphere: 0.05, link: workpiece, position: [0.1, 0, 0.3]}
- {name: nozzle, capsule: {radius: 0.02, length: 0.1}, link: tool, position: [0, 0, 0.06]}
""")


def task(**keys):
    return brachis.load_task(
        {
            "brachis": 1,
            "robot": {
                "urdf": "tx90l_positioner",
                "workpiece_frame": "workpiece",
                "mounting": MOUNTING,
            },
            "start": "free",
            "path_start": {"position": [0.07, 0, 0.2], "rpy_deg": [0, -90, 0]},
            "task_space": "pose_free_roll",
            "path": [{"line": {"by": [0, 0, 0.05]}}],
            "scene": BODIES,
            **keys,
        }
    )


@pytest.fixture(scope="module")
def cell():
    """Robot, task, scene and postures."""
    given = task()
    robot = robot_for(None, given.robot)
    found = scene_of(robot, given)
    assert found is not None
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (30, robot.n))
    return robot, given, found, q


def tree_placements(robot, q, link):
    """Placement of a link in the world, by Pinocchio's model of the whole tree."""
    model = pin.buildModelFromXML(robot.urdf)
    data = model.createData()
    full = pin.neutral(model)
    for name, position in zip(robot.joint_names, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        angle = [position] if joint.nq == 1 else [np.cos(position), np.sin(position)]
        full[joint.idx_q : joint.idx_q + joint.nq] = angle
    pin.framesForwardKinematics(model, data, full)
    turn = pin.rpy.rpyToMatrix(*np.radians(MOUNTING["rpy_deg"]))
    mounting = pin.SE3(turn, np.array(MOUNTING["xyz"]))
    return mounting * data.oMf[model.getFrameId(link)]


def test_distances_are_those_in_the_world(cell):
    robot, _, found, postures = cell
    placed = Chain.of(robot.model).place(postures)
    for mine, other in zip(placed, joint_placements(robot, postures), strict=True):
        assert_allclose(mine, other, atol=1e-12)
    names = [solid.name for solid in found.solids]
    kinds = [{names[i] for i in pair} for pair in found.pairs]
    assert {"post", "seam guard"} in kinds
    assert {"floor", "nozzle"} in kinds
    assert {"floor", "seam guard"} in kinds
    assert {"post", "floor"} not in kinds
    posture, pair = np.indices((len(postures), len(found.pairs))).reshape(2, -1)
    distances = found.measure(placed, posture, pair).distance
    bounds = found.bounds(placed)
    assert (bounds[posture, pair] <= distances + 1e-9).all()
    for k, number, distance in zip(posture, pair, distances, strict=True):
        if distance < 0.0:
            continue
        ends = []
        for index in found.pairs[number]:
            solid = found.solids[index]
            frame = pin.SE3.Identity()
            if solid.link is not None:
                frame = tree_placements(robot, postures[k], solid.link)
            ends.append(frame * pin.SE3(solid.placement))
        shapes = [found.solids[index].geometry for index in found.pairs[number]]
        transforms = [coal.Transform3s(end.rotation, end.translation) for end in ends]
        result = coal.DistanceResult()
        request = coal.DistanceRequest()
        expected = coal.distance(
            shapes[0], transforms[0], shapes[1], transforms[1], request, result
        )
        assert distance == pytest.approx(expected, abs=1e-5)


def test_derivatives_of_distances(cell):
    robot, given, _, postures = cell
    limit = build_clearance(robot, given)
    assert limit is not None
    still = np.zeros_like(postures)

    def values(q):
        return limit.values(Moments(q, still, still, still, np.zeros(len(q))))

    moment = Moments(postures, still, still, still, np.zeros(len(postures)))
    exact = limit.partials(moment).q
    clear = values(postures) > 1e-3 / UNIT
    assert clear.any()
    for joint in range(robot.n):
        step = 1e-6 * np.eye(robot.n)[joint]
        slopes = (values(postures + step) - values(postures - step)) / 2e-6
        error = np.abs(slopes - exact[:, :, joint])[clear]
        assert np.quantile(error, 0.98) < 1e-4
