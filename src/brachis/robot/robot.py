"""The robot: a Pinocchio model of the chain from base to tool, its limits and friction."""

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
from brachis.robot.chain import chain_of
from brachis.robot.friction import Friction
from brachis.robot.joints import UNITS
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

    Robots, like their limits, are equal only if they are the same object.

    Attributes
    ----------
    model : pinocchio.Model
        The chain alone, mounted, with payload and tool offset; ``nq == nv == n``. Treat it as read-only.
    joint_names : tuple of str
        Names of the n joints, from base to tool.
    tool_frame, base_frame : str
        Link names of the URDF.
    limits : Limits
        Limits of the n joints.
    urdf_limits : tuple of UrdfLimit
        Limits as the URDF states them.
    urdf_dynamics : UrdfDynamics
        Joints, bodies and friction as the URDF states them, without payload, mounting and tool offset.
    friction : Friction
        Torque terms that the rigid-body model lacks.
    settings : RobotSettings
        What the robot was made with, as the ``robot`` part of a task.
    source : str
        The URDF file that the robot was read from.
    urdf : str
        Text of that file.
    tool_joints : tuple of ToolJoint
        The last joints of the chain, which are virtual: by them the tool may leave the path; see `bind`.

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
        """Refuse a file name, which is for `from_urdf`."""
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
        """Build the model of the chain base -> tool; every joint off the chain is locked.

        Parameters
        ----------
        path : path
            URDF file, whose mesh files are not read; or MJCF file.
        urdf_text : str, optional
            Text of the URDF where it is already known; `path` then only names it.
        **keywords
            Keys of the ``robot`` part of a task; None for the default.
        tool_frame : str, optional
            Link at the end of the chain; the only leaf link if left out.
        base_frame : str, optional
            Link at the beginning of the chain; the root link if left out. Positions are those in the world frame,
            which is the URDF's root link unless `mounting` says otherwise.
        gravity : (3,) sequence of float, optional
            Gravitational acceleration in the world frame, m/s^2; (0, 0, -9.81) if left out.
        locked_joints : mapping of str to float, optional
            Joints held at a position, rad or m.
        limits : LimitSpec or mapping, optional
            Limits that override or complete the URDF's; those of joints off the chain have no effect.
        friction : mapping, optional
            ``armature``, ``viscous``, ``coulomb``, ...: keys of `FrictionSettings`; the others are taken from the URDF.
        payload : mapping or Payload, optional
            ``mass``, kg; ``com``, (3,) m, and ``inertia`` about it, kg m^2, in the tool frame of the URDF.
        tool_offset : mapping or Placement, optional
            ``xyz``, m, and ``rpy_deg``: where the frame that follows the path is in the tool frame of the URDF.
        mounting : {"floor", "wall", "ceiling"}, mapping or Placement, optional
            Where the URDF's root link is in the world.
        speed_override : float, optional
            Factor in (0, 1] on all velocity limits.

        Raises
        ------
        UrdfError, UnknownNameError, LimitError, InputError
            TaskError, one of them, where a keyword has a wrong form.
        """
        content = {key: value for key, value in keywords.items() if value is not None}
        content["urdf"] = str(Path(path).absolute())
        unchecked = {}
        if isinstance(content.get("limits"), LimitSpec):
            # It is checked below, where the joints are known.
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
        """Build the robot from a Pinocchio model: its frames, inertias, limits, friction, armature and gravity.

        Parameters
        ----------
        model : pinocchio.Model
            Joints of the chain have one axis; others, such as a free base, are held.
        frame : str, optional
            Body or added frame that follows the path, in place of ``tool_frame``.
        geometry : pinocchio.GeometryModel, optional
            Solids of the links, for distances.
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
        """Build the robot from the ``robot`` part of a task.

        Parameters
        ----------
        settings : RobotSettings
            ``urdf`` is not read.
        source : str
            The URDF file.
        urdf_text : str, optional
            Its text, if it is known already.

        Raises
        ------
        TaskError
            A file of limits was not read, because `load_task` did not make the task.
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
            settings=_without_defaults(settings.model_copy(update={"limits": spec})),
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
            Arguments of `LimitSpec`. A mapping by joint name changes those joints alone; ``scale`` multiplies the
            limits that the robot has.

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
        """Return the robot with another payload, in place of the one that it has.

        Parameters
        ----------
        mass : float or None
            kg; None: no payload.
        com : (3,) sequence of float, optional
            Centre of mass in the tool frame of the URDF, m.
        inertia : mapping, optional
            ``ixx``, ``iyy``, ... about the centre of mass, kg m^2; a point mass unless given.

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
        """Return what is shown."""
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
        """Write a value for each joint, (n,), with the unit of such a quantity."""
        units = [UNITS[quantity][unit] for unit in self.position_units]
        numbers = [f"{value:.4g}" if np.isfinite(value) else "none" for value in values]
        if len(set(units)) == 1:
            return f"{', '.join(numbers)} {units[0]}"
        pairs = zip(numbers, units, strict=True)
        return ", ".join(
            number if number == "none" else f"{number} {unit}" for number, unit in pairs
        )

    @property
    def has_masses(self) -> bool:
        """Whether the URDF has the masses that torques need."""
        return not self.urdf_dynamics.without_mass

    @property
    def name(self) -> str:
        """Name that the URDF gives the robot; empty where it gives none."""
        return read_tree(self.urdf, self.source).robot.get("name") or ""

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def urdf_joints(self) -> tuple[str, ...]:
        """Names of the joints without the virtual ones."""
        return self.joint_names[: self.n - len(self.tool_joints)]

    def of_real_joints(self, values: np.ndarray) -> np.ndarray:
        """Return values of joints, (..., n), with zeros for the virtual ones, which do not move the tool."""
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
        """Which joints turn, (n,) bool; the others slide."""
        return np.array(self.position_units) == "rad"

    @cached_property
    def scales(self) -> np.ndarray:
        """How far joints move, about, (n,): 1 rad or m; a virtual joint with a range half of it."""
        halves = [0.5 * (joint.upper - joint.lower) for joint in self.tool_joints]
        return np.append(np.ones(len(self.urdf_joints)), np.minimum(halves, 1.0))

    def posture(self, joints: object, where: str) -> np.ndarray:
        """Check a list or mapping of joint positions and return it as (n,) in chain order, rad or m.

        Positions of virtual joints may be left out; they are zero then, or at the end of the range that is nearer.

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
        """The chain as the compiled kernel takes it."""
        return chain_of(self.model, self.frame_id, self.friction.table)

    def check_masses(self, *users: str) -> None:
        """Refuse users of masses, by default those of the task, if the URDF lacks masses.

        Raises
        ------
        UrdfError
        """
        dynamics = self.urdf_dynamics
        known = users or list_users(dynamics, self.limits, self.friction, self.settings)
        check_masses(dynamics, self.source, known)

    def place_joints(self, q: np.ndarray) -> Iterator[pin.Data]:
        """Yield Pinocchio's placements of all joints and of the tool frame in postures (K, n), one after the other.

        They share one workspace: copy what you keep.
        """
        model = self.model
        data = model.createData()
        tool = self.frame_id
        for posture in np.asarray(q, dtype=float):
            pin.forwardKinematics(model, data, posture)
            pin.updateFramePlacement(model, data, tool)
            yield data

    def tool_placement(self, q: ArrayLike | Mapping[str, float]) -> pin.SE3:
        """Placement of the tool frame in the world frame at one posture.

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
        """Positions (K, 3), m, and rotations (K, 3, 3) of the tool frame in the world frame, from postures (K, n)."""
        positions = np.empty((len(q), 3))
        rotations = np.empty((len(q), 3, 3))
        tool = self.frame_id
        for k, data in enumerate(self.place_joints(q)):
            placement = data.oMf[tool]
            positions[k] = placement.translation
            rotations[k] = placement.rotation
        return positions, rotations

    def heights(self, q: np.ndarray) -> np.ndarray:
        """Heights of the tool frame above the plane on which the robot stands, (K,) m, from postures (K, n).

        The plane goes through the base frame; its normal is the z axis of the URDF's root link.
        """
        base = self.model.getFrameId(self.base_frame, pin.FrameType.BODY)
        floor = self.model.frames[base].placement.translation
        up = placement_matrix(self.settings.mounting)[:3, 2]
        return (self.tool_placements(q)[0] - floor) @ up


def _without_defaults(settings: RobotSettings) -> RobotSettings:
    """Leave out settings that have their default, so that others can be added."""
    default = RobotSettings()
    return RobotSettings(
        **{key: value for key, value in settings if value != getattr(default, key)}
    )
