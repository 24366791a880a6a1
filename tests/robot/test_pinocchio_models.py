"""Robots from models of Pinocchio; the model itself says what is right."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import brachis
from brachis.errors import InputError, UnknownNameError, UrdfError
from brachis.robot.urdf_elements import read_tree

ROBOTS = [name for name in brachis.robots.names() if name != "tx90l_positioner"]


def model_of(name):
    return pin.buildModelFromUrdf(str(brachis.robots.path_of(name)))


def arm(*joints, frame="tip"):
    """A chain of joints with masses, 0.3 m apart, and a frame beyond the last one."""
    model = pin.Model()
    model.name = "arm"
    number = 0
    placement = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.4, 0.5), np.array([0.1, 0.2, 0.3]))
    for i, joint in enumerate(joints):
        number = model.addJoint(number, joint, placement, f"q{i}")
        model.appendBodyToJoint(
            number, pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3), placement
        )
    model.addFrame(pin.Frame(frame, number, 0, placement, pin.FrameType.OP_FRAME))
    return model


def assert_same(robot, model, frame, kind=pin.FrameType.BODY):
    """Tool placements and torques are the model's."""
    data = model.createData()
    assert list(robot.joint_names) == list(model.names)[1:]
    for q in np.random.default_rng(0).uniform(-1.0, 1.0, (5, robot.n)):
        full = np.concatenate(
            [
                [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
                for angle, joint in zip(q, list(model.joints)[1:], strict=True)
            ]
        )
        pin.framesForwardKinematics(model, data, full)
        placement = data.oMf[model.getFrameId(frame, kind)]
        assert robot.tool_placement(q).isApprox(placement, 1e-12)
        v = np.cos(q)
        expected = pin.rnea(model, data, full, v, q)
        found = pin.rnea(robot.model, robot.model.createData(), q, v, q)
        found += robot.friction.armature * q
        assert found == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("name", ROBOTS)
def test_models_of_urdfs(name):
    expected = getattr(brachis.robots, name)
    model = model_of(name)
    robot = brachis.Robot.from_pinocchio(model)
    assert robot.tool_frame == expected.tool_frame
    assert robot.name == expected.name
    assert_same(robot, model, robot.tool_frame)
    assert {*read_tree(robot.urdf, "").links} == {*read_tree(expected.urdf, "").links}
    for kind in ("position", "velocity", "torque"):
        figures = robot.limits.both_ways(kind)
        assert figures == pytest.approx(expected.limits.both_ways(kind))


def test_axes_armature_gravity_and_joints_of_two_coordinates():
    axis = np.array([0.6, 0.0, 0.8])
    model = arm(
        pin.JointModelRUBX(),
        pin.JointModelRevoluteUnaligned(axis),
        pin.JointModelPrismaticUnaligned(axis),
        pin.JointModelRUBZ(),
        pin.JointModelPY(),
    )
    model.armature = np.array([0.5, 0.0, 2.0, 0.1, 0.2])
    model.damping = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    model.gravity.linear = np.array([0.0, 1.0, -5.0])
    model.lowerPositionLimit[2:4] = -2.0
    model.upperPositionLimit[2:4] = 3.0
    model.lowerPositionLimit[-1] = -1.0
    model.upperPositionLimit[-1] = 1.0
    robot = brachis.Robot.from_pinocchio(model, "tip", limits={"torque": 1e6})
    assert_same(robot, model, "tip", pin.FrameType.OP_FRAME)
    assert robot.friction.armature.tolist() == [0.5, 0.0, 2.0, 0.1, 0.2]
    assert robot.friction.viscous.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert robot.limits.position_lower.tolist() == [-np.inf, -2.0, -2.0, -np.inf, -1.0]
    options = {"gravity": [0, 0, 0], "friction": {"armature": 0}}
    free = brachis.Robot.from_pinocchio(model, "tip", limits={"torque": 1e6}, **options)
    assert not free.friction.armature.any()
    assert not free.model.gravity.linear.any()


def test_a_rotor_replaces_the_armature_of_the_model():
    model = model_of("scara3")
    model.armature = np.array([0.5, 0.6, 0.7])
    rotor = {"rotor_inertia": {"j1": 1e-4}, "gear_ratio": 100}
    robot = brachis.Robot.from_pinocchio(model, friction=rotor)
    assert robot.friction.armature == pytest.approx([1.0, 0.6, 0.7])


@pytest.mark.parametrize("unstated", [np.inf, np.finfo(float).max])
def test_limits_without_a_figure(unstated):
    model = model_of("tx90l_rail")
    model.velocityLimit[1] = unstated
    model.effortLimit[2] = unstated
    with pytest.raises(InputError, match="'joint_2': there is neither a torque"):
        brachis.Robot.from_pinocchio(model)
    limits = {"torque": {"joint_2": 100.0}}
    robot = brachis.Robot.from_pinocchio(model, limits=limits)
    assert (robot.urdf_limits[1].velocity, robot.urdf_limits[2].effort) == (None, None)
    assert robot.urdf_limits[1].effort == model.effortLimit[1]
    model.lowerPositionLimit[0] = -unstated
    model.upperPositionLimit[0] = unstated
    with pytest.raises(InputError, match="rail"):
        brachis.Robot.from_pinocchio(model, limits=limits)
    limits["position"] = {"rail": [-1.0, 1.0]}
    robot = brachis.Robot.from_pinocchio(model, limits=limits)
    assert robot.limits.position_lower[0] == -1.0


@pytest.mark.parametrize(
    "joint",
    [
        pin.JointModelFreeFlyer(),
        pin.JointModelSpherical(),
        pin.JointModelPlanar(),
        pin.JointModelHX(0.1),
    ],
    ids=lambda joint: joint.shortname(),
)
def test_joints_with_several_coordinates_cannot_be_planned_for(joint):
    model = arm(joint, pin.JointModelRZ(), pin.JointModelRX())
    limits = {"torque": 1.0, "velocity": 1.0}
    with pytest.raises(
        UrdfError,
        match=r"'q0' cannot be planned for; found type 'floating'.*base_frame below it",
    ):
        brachis.Robot.from_pinocchio(model, "tip", limits=limits)
    robot = brachis.Robot.from_pinocchio(model, "tip", base_frame="q0", limits=limits)
    assert robot.joint_names == ("q1", "q2")
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    assert robot.tool_placement([0.0, 0.0]).isApprox(data.oMf[model.getFrameId("tip")])


def test_names_that_come_twice_and_unknown_frames():
    model = arm(pin.JointModelRZ(), pin.JointModelRX(), frame="q0")
    limits = {"torque": 1.0, "velocity": 1.0}
    robot = brachis.Robot.from_pinocchio(model, "q0_", limits=limits)
    assert robot.tool_placement([0.0, 0.0]).translation[2] != pytest.approx(0.3)
    with pytest.raises(
        UnknownNameError, match="no frame named 'tool'; allowed: universe, q0, q1, q0_"
    ):
        brachis.Robot.from_pinocchio(model, "tool", limits=limits)


def test_solids_of_a_geometry_model_become_those_of_the_robot(tmp_path):
    mesh = tmp_path / "a & b.stl"
    mesh.write_text("solid\nendsolid\n")
    model = model_of("scara3")
    geometry = pin.GeometryModel()
    away = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.1]))
    shapes = {
        "box {'size': '0.1 0.2 0.3'}": coal.Box(0.1, 0.2, 0.3),
        "sphere {'radius': '0.1'}": coal.Sphere(0.1),
        "cylinder {'radius': '0.1', 'length': '0.4'}": coal.Cylinder(0.1, 0.4),
        "capsule {'radius': '0.1', 'length': '0.4'}": coal.Capsule(0.1, 0.4),
    }
    for name, shape in shapes.items():
        geometry.addGeometryObject(pin.GeometryObject(name, 2, away, shape))
    robot = brachis.Robot.from_pinocchio(model, geometry=geometry)
    (link,) = read_tree(robot.urdf, "").robot.xpath("link[collision]")
    assert link.get("name") == "link2"
    solids = link.iterfind("collision/geometry/*")
    assert [f"{solid.tag} {dict(solid.attrib)}" for solid in solids] == [*shapes]
    assert link.find("collision/origin").get("xyz") == "0.5 0 0.1"
    half = coal.Halfspace()
    solid = pin.GeometryObject("mesh", 1, away, half, str(mesh), np.full(3, 0.001))
    geometry.addGeometryObject(solid)
    robot = brachis.Robot.from_pinocchio(model, geometry=geometry)
    (file,) = read_tree(robot.urdf, "").robot.iter("mesh")
    assert dict(file.attrib) == {"filename": str(mesh), "scale": "0.001 0.001 0.001"}
    geometry.addGeometryObject(pin.GeometryObject("floor", 0, away, half))
    message = r"geometry: floor: .*found halfspace; allowed: a box"
    with pytest.raises(UrdfError, match=message):
        brachis.Robot.from_pinocchio(model, geometry=geometry)
