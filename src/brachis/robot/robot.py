"""The robot: a Pinocchio model of the chain from base to tool, with limits and friction."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from brachis.common.arguments import check_keywords
from brachis.common.summary import Summary
from brachis.errors import InputError, TaskError, check_names
from brachis.kernel import Chain
from brachis.robot.chain import chain_in_world, chain_of
from brachis.robot.friction import Friction
from brachis.robot.joints import write_values
from brachis.robot.limits import (
    Limits,
    UrdfLimit,
    check_limits,
    resolve_limits,
    to_spec,
    without_joints,
)
from brachis.robot.masses import check_masses, list_users
from brachis.robot.model import build_model
from brachis.robot.posture import read_posture
from brachis.robot.tool_joints import ToolJoint
from brachis.robot.urdf import read_chain, read_file
from brachis.robot.urdf_bodies import UrdfDynamics, placement_matrix
from brachis.robot.urdf_elements import read_tree
from brachis.robot.urdf_writer import write_urdf
from brachis.task import (
    LimitKeywords,
    LimitSpec,
    RobotKeywords,
    RobotSettings,
    check_robot_settings,
)
from brachis.task.fields import merge


@dataclass(frozen=True, repr=False, eq=False)
class Robot(Summary):
    """A serial chain of one-coordinate joints with limits.

    Robots are equal only if they are the same object. The same holds for their limits.

    Attributes
    ----------
    model : pinocchio.Model
        The chain alone, with mounting, payload and tool offset; ``nq == nv == n``. Treat it as read-only.
    joint_names : tuple of str
        Names of the n joints, from base to tool.
    tool_frame, base_frame : str
        Link names of the URDF.
    limits : Limits
        Limits of the n joints.
    urdf_limits : tuple of UrdfLimit
        Limits as stated in the URDF.
    urdf_dynamics : UrdfDynamics
        Joints, bodies and friction as stated in the URDF, without payload, mounting and tool offset.
    friction : Friction
        Torque terms that are not in the rigid-body model.
    settings : RobotSettings
        The settings from which the robot was built, as in the ``robot`` section of a task.
    source : str
        The URDF file that the robot was read from.
    urdf : str
        Text of that file.
    tool_joints : tuple of ToolJoint
        Virtual joints at the end of the chain, by which the tool may deviate from the path; see `bind`.

    Examples
    --------
    >>> import brachis
    >>> robot = brachis.Robot.from_urdf("robots/scara3/robot.urdf", tool_frame="tool", gravity=[0, 0, 0])
    >>> robot.tool_placement([0.0, 0.0, 0.0]).translation.round(6).tolist()
    [3.0, 0.0, 0.0]
    """

    model: pin.Model
    joint_names: tuple[str, ...]
    tool_frame: str
    base_frame: str
    limits: Limits
    urdf_limits: tuple[UrdfLimit, ...]
    urdf_dynamics: UrdfDynamics
    friction: Friction
    settings: RobotSettings
    source: str
    urdf: str
    tool_joints: tuple[ToolJoint, ...] = ()

    def __new__(cls, *arguments: object, **named_fields: object) -> Self:
        """Refuse a file name, which `from_urdf` reads."""
        if arguments or (named_fields and "model" not in named_fields):
            raise InputError(
                "a robot cannot be made from these arguments",
                where="Robot",
                found=arguments or named_fields,
                allowed='brachis.Robot.from_urdf("robot.urdf")',
            )
        return super().__new__(cls)

    @classmethod
    def from_urdf(
        cls,
        path: str | os.PathLike[str],
        *,
        urdf_text: str | None = None,
        **keywords: Unpack[RobotKeywords],
    ) -> Robot:
        """Build the robot from a URDF. Every joint that is not between base and tool is locked.

        Parameters
        ----------
        path : path
            URDF file, whose mesh files are not read, or MJCF file.
        urdf_text : str, optional
            Text of the URDF, if it is already known; `path` is then only a name.
        **keywords
            Keys of the ``robot`` section of a task. None stands for the default.
        tool_frame : str, optional
            Link at the end of the chain. Default: the only leaf link.
        base_frame : str, optional
            Link at the beginning of the chain. Default: the root link. Positions are in the world frame, which is the
            root link of the URDF unless `mounting` places it elsewhere.
        workpiece_frame : str, optional
            Link that carries the workpiece. Paths and the tool's positions are then in its frame. The joints that carry
            it come first in the chain, the last one at the beginning.
        gravity : (3,) sequence of float, optional
            Gravitational acceleration in the world frame, m/s^2. Default: (0, 0, -9.81).
        locked_joints : mapping of str to float, optional
            Joints that are held at a position, rad or m.
        limits : LimitSpec or mapping, optional
            Limits that override or complete those of the URDF. Limits of joints outside the chain have no effect.
        friction : mapping, optional
            ``armature``, ``viscous``, ``coulomb``, ...: keys of `FrictionSettings`. Keys that are left out keep the
            values of the URDF.
        payload : mapping or Payload, optional
            ``mass``, kg; ``com``, (3,) m, and ``inertia`` about ``com``, kg m^2, both in the tool frame of the URDF.
        tool_offset : mapping or Placement, optional
            ``xyz``, m, and ``rpy_deg``: pose of the frame that follows the path, in the tool frame of the URDF.
        mounting : {"floor", "wall", "ceiling"}, mapping or Placement, optional
            Pose of the URDF's root link in the world.
        speed_override : float, optional
            Factor in (0, 1] on all velocity limits.

        Raises
        ------
        UrdfError, UnknownNameError, LimitError, InputError
            The URDF or a keyword is wrong. A keyword with a wrong form raises a `TaskError`, which is an `InputError`.
        """
        content = {key: value for key, value in keywords.items() if value is not None}
        content["urdf"] = str(Path(path).absolute())
        unchecked = {}
        if isinstance(content.get("limits"), LimitSpec):
            # A `LimitSpec` is checked later, when the joints are known.
            unchecked["limits"] = content.pop("limits")
        settings = check_robot_settings(content).model_copy(update=unchecked)
        return cls.from_settings(settings, str(path), urdf_text)

    @classmethod
    def from_pinocchio(
        cls,
        model: pin.Model,
        frame: str | None = None,
        *,
        geometry: pin.GeometryModel | None = None,
        **keywords: Unpack[RobotKeywords],
    ) -> Robot:
        """Build the robot from a Pinocchio model: from its frames, inertias, limits, friction, armature and gravity.

        Parameters
        ----------
        model : pinocchio.Model
            Joints of the chain must have one axis. Other joints, such as a free base, are held.
        frame : str, optional
            Body or added frame that follows the path; used in place of ``tool_frame``.
        geometry : pinocchio.GeometryModel, optional
            Solids of the links, from which distances are computed.
        **keywords
            As for `from_urdf`.

        Examples
        --------
        >>> import brachis, pinocchio
        >>> model = pinocchio.buildModelFromUrdf("robots/scara3/robot.urdf")
        >>> brachis.Robot.from_pinocchio(model, "link3").joint_names
        ('j1', 'j2', 'j3')
        """
        text = write_urdf(model, geometry)
        keywords = {"tool_frame": frame, "gravity": model.gravity.linear, **keywords}
        return cls.from_urdf(f"{model.name}.urdf", urdf_text=text, **keywords)

    @classmethod
    def from_settings(
        cls, settings: RobotSettings, source: str, urdf_text: str | None = None
    ) -> Robot:
        """Build the robot from the ``robot`` section of a task.

        Parameters
        ----------
        settings : RobotSettings
            The settings; their ``urdf`` is not read.
        source : str
            The URDF file.
        urdf_text : str, optional
            Text of the file, if it is already known.

        Raises
        ------
        TaskError
            The limits file was not read, because the task was not made by `load_task`.
        UrdfError, UnknownNameError, LimitError, InputError
            See `from_urdf`.
        """
        if settings.limits_file is not None:
            raise TaskError(
                "the limits file was not read",
                where="robot.limits_file",
                found=settings.limits_file,
                hint="Make the task with brachis.load_task, or give robot.limits",
            )
        text = read_file(Path(source)) if urdf_text is None else urdf_text
        chain = read_chain(
            text,
            source,
            settings.tool_frame,
            settings.base_frame,
            tuple(settings.locked_joints.items()),
            settings.workpiece_frame,
        )
        names = chain.joint_names
        spec = check_limits(without_joints(settings.limits, chain.locked), names)
        limits = resolve_limits(spec, names, chain.limits, settings.speed_override)
        model = build_model(chain, settings, source)
        friction = Friction.of(names, chain.dynamics.friction, settings.friction)
        friction.check_against(model, limits.torque)
        robot = cls(
            model=model,
            joint_names=names,
            tool_frame=chain.tool_frame,
            base_frame=chain.base_frame,
            limits=limits,
            urdf_limits=chain.limits,
            urdf_dynamics=chain.dynamics,
            friction=friction,
            settings=settings.model_copy(update={"limits": spec}).without_defaults(),
            source=source,
            urdf=text,
        )
        robot.check_masses()
        return robot

    def with_limits(self, **limits: Unpack[LimitKeywords]) -> Robot:
        """Return the robot with some of its limits changed.

        Parameters
        ----------
        **limits
            Arguments of `LimitSpec`. A mapping by joint name changes only the joints it names; ``scale`` multiplies the
            robot's present limits.

        Raises
        ------
        LimitError, UnknownNameError, InputError
            See `Robot.from_urdf`.

        Examples
        --------
        >>> import brachis
        >>> robot = brachis.robots.scara3.with_limits(torque={"j1": 20.0}, velocity=2.0)
        >>> robot.limits.torque.tolist(), robot.limits.velocity.tolist()
        ([20.0, 10.0, 10.0], [2.0, 2.0, 2.0])
        """
        names = self.urdf_joints
        stated = vars(to_spec(self.limits, names))
        check_names("limit", limits, stated, "with_limits")
        spec = check_limits(LimitSpec(**merge(stated, limits)), names)
        resolved = resolve_limits(spec, names, self.urdf_limits[: len(names)])
        resolved = resolved.with_tool_joints(self.tool_joints)
        self.friction.check_against(self.model, resolved.torque)
        changed = {"limits": spec, "speed_override": 1.0}
        settings = self.settings.model_copy(update=changed)
        robot = replace(self, limits=resolved, settings=settings)
        robot.check_masses()
        return robot

    @check_keywords
    def with_payload(
        self,
        mass: float | None,
        *,
        com: Sequence[float] = (0.0, 0.0, 0.0),
        inertia: Mapping[str, float] | None = None,
    ) -> Robot:
        """Return the robot with a new payload, which replaces its present payload.

        Parameters
        ----------
        mass : float or None
            kg; None: no payload.
        com : (3,) sequence of float, optional
            Centre of mass in the tool frame of the URDF, m.
        inertia : mapping, optional
            ``ixx``, ``iyy``, ... about the centre of mass, kg m^2. Default: a point mass.

        Raises
        ------
        TaskError, InputError
            See `Robot.from_urdf`.

        Examples
        --------
        >>> import brachis
        >>> brachis.robots.iiwa14.with_payload(5.0, com=[0, 0, 0.1]).settings.payload
        Payload(mass=5, com=[0, 0, 0.1])
        """
        payload = {"mass": mass, "com": com, "inertia": inertia}
        checked = check_robot_settings({"payload": None if mass is None else payload})
        changes = {
            "payload": checked.payload,
            "gravity": tuple(self.model.gravity.linear),
        }
        settings = self.settings.model_copy(update=changes)
        robot = Robot.from_settings(settings, self.source, self.urdf)
        if self.tool_joints:
            return robot
        return replace(robot, limits=self.limits, friction=self.friction)

    def summary(self) -> Mapping[str, object]:
        """Return the entries that are shown to the user."""
        limits = self.limits
        payload = self.settings.payload
        return {
            "urdf": self.source,
            "joints": ", ".join(self.joint_names),
            "tool frame": self.tool_frame,
            "from": self.in_words(limits.position_lower),
            "to": self.in_words(limits.position_upper),
            "torque": self.in_words(limits.torque, "torque"),
            "velocity": self.in_words(limits.velocity, "velocity"),
            **({} if payload is None else {"payload": f"{payload.mass:g} kg"}),
        }

    def in_words(self, values: np.ndarray, quantity: str = "position") -> str:
        """Write the values of a quantity, (n,), with their units."""
        return write_values(values, quantity, self.position_units)

    @property
    def has_masses(self) -> bool:
        """Whether the URDF contains the masses that torques need."""
        return not self.urdf_dynamics.without_mass

    @property
    def name(self) -> str:
        """Name of the robot in the URDF; empty if it has none."""
        return read_tree(self.urdf, self.source).robot.get("name") or ""

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def urdf_joints(self) -> tuple[str, ...]:
        """Names of the joints, without the virtual joints."""
        return self.joint_names[: self.n - len(self.tool_joints)]

    def of_real_joints(self, values: np.ndarray) -> np.ndarray:
        """Set values of joints, (..., n), to zero for the virtual joints, which do not move the tool."""
        if not self.tool_joints:
            return values
        return np.where(np.arange(self.n) < len(self.urdf_joints), values, 0.0)

    @property
    def frame_id(self) -> int:
        """Pinocchio's index of the tool frame."""
        kind = pin.FrameType.OP_FRAME if self.tool_joints else pin.FrameType.BODY
        return int(self.model.getFrameId(self.tool_frame, kind))

    @property
    def position_units(self) -> tuple[str, ...]:
        """Unit of every joint's position, ``rad`` or ``m``."""
        return tuple(
            "m" if "P" in joint.shortname() else "rad"
            for joint in list(self.model.joints)[1:]
        )

    @property
    def revolute(self) -> np.ndarray:
        """Which joints are revolute, (n,) bool; the others are prismatic."""
        return np.array(self.position_units) == "rad"

    @cached_property
    def scales(self) -> np.ndarray:
        """Typical size of a motion of each joint, (n,): 1 rad or m; for a virtual joint, at most half of its range."""
        halves = [0.5 * (joint.upper - joint.lower) for joint in self.tool_joints]
        return np.append(np.ones(len(self.urdf_joints)), np.minimum(halves, 1.0))

    def posture(self, joints: object, where: str) -> np.ndarray:
        """Check a list or mapping of joint positions, and return them in chain order, (n,), rad or m.

        Positions of virtual joints may be left out. Their default is zero, or the end of the range closest to zero.

        Raises
        ------
        InputError, UnknownNameError
            See `read_posture`.
        """
        still = {
            joint.name: float(np.clip(0.0, joint.lower, joint.upper))
            for joint in self.tool_joints
        }
        return read_posture(joints, self.joint_names, still, where)

    @cached_property
    def chain(self) -> Chain:
        """The chain in the form that the compiled kernel needs, in the frame of the paths."""
        return chain_of(self.model, self.frame_id, self.friction.table)

    @cached_property
    def dynamic_chain(self) -> Chain:
        """The same chain for torques. It differs only if there is a workpiece frame."""
        if self.settings.workpiece_frame is None:
            return self.chain
        carriers = self.urdf_dynamics.carriers
        return chain_in_world(self.model, self.chain, carriers, self.world)

    @cached_property
    def world(self) -> tuple[int, np.ndarray]:
        """Number of the joint before the world, and the world's placement, (4, 4), in the joint's frame.

        Without a workpiece frame, no joint is before the world.
        """
        if self.settings.workpiece_frame is None:
            return 0, np.eye(4)
        joint, root = self.urdf_dynamics.links[self.urdf_dynamics.root]
        return joint, root @ np.linalg.inv(placement_matrix(self.settings.mounting))

    def check_masses(self, *users: str) -> None:
        """Refuse features that need masses, by default those of the task, if the URDF lacks masses.

        Raises
        ------
        UrdfError
        """
        dynamics = self.urdf_dynamics
        known = users or list_users(dynamics, self.limits, self.friction, self.settings)
        check_masses(dynamics, self.source, known)

    def place_joints(self, q: np.ndarray) -> Iterator[pin.Data]:
        """Yield Pinocchio's placements of all joints and of the tool frame, posture by posture, for postures (K, n).

        All placements share one workspace, so copy data that you want to keep.
        """
        model = self.model
        data = model.createData()
        tool = self.frame_id
        for posture in np.asarray(q, dtype=float):
            pin.forwardKinematics(model, data, posture)
            pin.updateFramePlacement(model, data, tool)
            yield data

    def tool_placement(self, q: ArrayLike | Mapping[str, float]) -> pin.SE3:
        """Return the placement of the tool frame in one posture, in the world or in the workpiece frame.

        Parameters
        ----------
        q : (n,) array or mapping of str to float
            Joint positions, rad or m, in chain order or by joint name.

        Raises
        ------
        InputError, UnknownNameError
            See `posture`.
        """
        (data,) = self.place_joints(self.posture(q, "tool_placement")[None])
        return data.oMf[self.frame_id].copy()

    def tool_placements(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions, (K, 3), m, and rotations, (K, 3, 3), of the tool frame in postures (K, n)."""
        positions = np.empty((len(q), 3))
        rotations = np.empty((len(q), 3, 3))
        tool = self.frame_id
        for k, data in enumerate(self.place_joints(q)):
            placement = data.oMf[tool]
            positions[k] = placement.translation
            rotations[k] = placement.rotation
        return positions, rotations
