"""The robot: a Pinocchio model of the chain from base to tool, its limits and friction."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self, Unpack

import numpy as np
import pinocchio as pin

from brachis.common.arguments import check_keywords
from brachis.common.summary import Summary
from brachis.errors import InputError, UnknownNameError
from brachis.robot.friction import Friction
from brachis.robot.joints import UNITS
from brachis.robot.limits import (
    FARTHEST,
    LARGEST,
    Limits,
    UrdfLimit,
    per_joint_values,
    resolve_limits,
    to_spec,
    without_joints,
)
from brachis.robot.model import build_model
from brachis.robot.settings import settings_used
from brachis.robot.urdf import read_chain, read_file
from brachis.robot.urdf_bodies import StatedChain
from brachis.robot.urdf_elements import read_tree
from brachis.task import (
    LimitKeywords,
    LimitSpec,
    Payload,
    Placement,
    RobotSettings,
    check_robot_settings,
)

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
ROLL_JOINT = "tool_roll"
"""The virtual joint by which a tool rolls freely about its z axis; see `free_roll`."""


@dataclass(frozen=True, repr=False)
class Robot(Summary):
    """A serial chain of one-coordinate joints with limits.

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
    stated_limits : tuple of UrdfLimit
        Limits as the URDF states them.
    stated : StatedChain
        Joints, bodies and friction as the URDF states them, without payload, mounting and tool offset.
    friction : Friction
        Torque terms beside the rigid-body model's.
    settings : RobotSettings
        What the robot was made with, as the ``robot`` part of a task.
    source : str
        The URDF file that the robot was read from.
    urdf : str
        Text of that file.
    rolls_freely : bool
        Whether the last joint is the virtual one by which the tool rolls freely; see `bind`.

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
    stated_limits: tuple[UrdfLimit, ...]
    stated: StatedChain
    friction: Friction
    settings: RobotSettings
    source: str
    urdf: str
    rolls_freely: bool = False

    def __new__(cls, *given: object, **named_fields: object) -> Self:
        """Refuse a file name, which is for `from_urdf`."""
        if given or (named_fields and "model" not in named_fields):
            allowed = 'brachis.Robot.from_urdf("robot.urdf")'
            raise InputError(
                "a robot is not made of these",
                where="Robot",
                found=given or named_fields,
                allowed=allowed,
            )
        return super().__new__(cls)

    @classmethod
    def from_urdf(
        cls,
        path: str | os.PathLike[str],
        *,
        urdf_text: str | None = None,
        tool_frame: str | None = None,
        base_frame: str | None = None,
        gravity: Sequence[float] = STANDARD_GRAVITY,
        locked_joints: Mapping[str, float] | None = None,
        limits: LimitSpec | LimitKeywords | None = None,
        friction: Mapping[str, object] | None = None,
        payload: Mapping[str, object] | Payload | None = None,
        tool_offset: Mapping[str, object] | Placement | None = None,
        mounting: str | Mapping[str, object] | Placement = "floor",
        speed_override: float = 1.0,
    ) -> Robot:
        """Build the model of the chain base -> tool; every joint off the chain is locked.

        Parameters
        ----------
        path : path
            URDF file. Mesh files are not read.
        urdf_text : str, optional
            Text of the URDF where it is already known; `path` then only names it.
        tool_frame : str, optional
            Link at the end of the chain; the only leaf link if left out.
        base_frame : str, optional
            Link at the beginning of the chain; the root link if left out. Positions are those in the world frame,
            which is the URDF's root link unless `mounting` says otherwise.
        gravity : (3,) sequence of float, optional
            Gravitational acceleration in the world frame, m/s^2.
        locked_joints : mapping of str to float, optional
            Joints held at a position, rad or m.
        limits : LimitSpec or mapping, optional
            Limits that override or complete the URDF's; those of joints off the chain, which stand still, have no
            effect.
        friction : mapping, optional
            Keyword arguments of `Friction.of`; what it leaves out is taken from the URDF.
        payload : mapping or Payload, optional
            ``mass``, kg; ``com``, (3,) m, and ``inertia`` about it, kg m^2, in the tool frame of the URDF.
        tool_offset : mapping or Placement, optional
            ``xyz``, m, and ``rpy_deg``: where the frame that follows the path is in the tool frame of the URDF.
        mounting : {"floor", "wall", "ceiling"}, mapping or Placement, optional
            Where the URDF's root link is in the world.
        speed_override : float, optional
            Factor in (0, 1] on all velocity limits.

        Returns
        -------
        Robot

        Raises
        ------
        UrdfError, UnknownNameError, LimitError, InputError
            TaskError, one of them, where payload, tool offset, mounting or speed override are not what they should be.
        """
        added = check_robot_settings(
            {
                "payload": payload,
                "tool_offset": tool_offset or {},
                "mounting": mounting,
                "speed_override": speed_override,
            }
        )
        spec = (
            check_robot_settings({"limits": limits}).limits
            if isinstance(limits, Mapping)
            else limits or LimitSpec()
        )
        vector = _vector(gravity)
        text = read_file(Path(path)) if urdf_text is None else urdf_text
        chain = read_chain(
            text,
            str(path),
            tool_frame=tool_frame,
            base_frame=base_frame,
            locked_joints=dict(locked_joints or {}),
        )
        spec = without_joints(spec, chain.locked)
        model, names = build_model(chain, vector, added, str(path)), chain.joint_names
        resolved = resolve_limits(spec, names, chain.limits, added.speed_override)
        terms = Friction.of(names, chain.stated.friction, **dict(friction or {}))
        terms.check_against(model, resolved.torque)
        return cls(
            model=model,
            joint_names=names,
            tool_frame=chain.tool_frame,
            base_frame=chain.base_frame,
            limits=resolved,
            stated_limits=chain.limits,
            stated=chain.stated,
            friction=terms,
            settings=settings_used(
                added,
                path,
                names,
                tool_frame,
                base_frame,
                vector,
                locked_joints,
                spec,
                friction,
            ),
            source=str(path),
            urdf=text,
        )

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
        own = self.joint_names[: len(self.joint_names) - self.rolls_freely]
        kept = to_spec(self.limits, own)
        changes: dict[str, Any] = {}
        for kind, value in limits.items():
            if kind not in LimitKeywords.__annotations__:
                raise UnknownNameError(
                    "limit", kind, LimitKeywords.__annotations__, where="with_limits"
                )
            stated = getattr(kept, kind)
            if isinstance(value, Mapping) and isinstance(stated, Mapping):
                changes[kind] = {**stated, **value}
            else:
                changes[kind] = value
        spec = LimitSpec(**{**vars(kept), **changes})
        resolved = resolve_limits(spec, own, self.stated_limits[: len(own)])
        resolved = resolved.with_free_joint() if self.rolls_freely else resolved
        self.friction.check_against(self.model, resolved.torque)
        settings = self.settings.model_copy(
            update={"limits": spec, "speed_override": 1.0}
        )
        return replace(self, limits=resolved, settings=settings)

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
        settings = self.settings
        payload = (
            None if mass is None else {"mass": mass, "com": com, "inertia": inertia}
        )
        made = Robot.from_urdf(
            self.source,
            urdf_text=self.urdf,
            tool_frame=settings.tool_frame,
            base_frame=settings.base_frame,
            gravity=self.model.gravity.linear,
            locked_joints=settings.locked_joints,
            limits=settings.limits,
            friction=settings.friction.model_dump(),
            payload=payload,
            tool_offset=settings.tool_offset,
            mounting=settings.mounting,
            speed_override=settings.speed_override,
        )
        return (
            made
            if self.rolls_freely
            else replace(made, limits=self.limits, friction=self.friction)
        )

    def summary(self) -> Mapping[str, object]:
        """Return what is shown."""
        limits, payload = self.limits, self.settings.payload
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
    def name(self) -> str:
        """Name that the URDF gives the robot; empty where it gives none."""
        return read_tree(self.urdf, self.source).robot.get("name") or ""

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def frame_id(self) -> int:
        """Pinocchio's index of the tool frame."""
        kind = pin.FrameType.OP_FRAME if self.rolls_freely else pin.FrameType.BODY
        return int(self.model.getFrameId(self.tool_frame, kind))

    @property
    def position_units(self) -> tuple[str, ...]:
        """Unit of every joint's position, ``rad`` or ``m``."""
        return tuple(
            "m" if "P" in joint.shortname() else "rad"
            for joint in list(self.model.joints)[1:]
        )

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of every joint's torque, ``Nm``, or of its force, ``N``."""
        return tuple(UNITS["torque"][unit] for unit in self.position_units)

    @property
    def revolute(self) -> np.ndarray:
        """Which joints turn, (n,) bool; the others slide."""
        return np.array([unit == "rad" for unit in self.position_units])

    def posture(self, joints: object, where: str) -> np.ndarray:
        """Check a list or mapping of joint positions and return it as (n,) in chain order, rad or m.

        The position of the virtual joint of a freely rolling tool may be left out; it is zero then.

        Raises
        ------
        InputError, UnknownNameError
            A joint is missing, unknown or not finite, or the list has another length than the chain.
        """
        if self.rolls_freely:
            joints = _with_roll(joints, self.n)
        values = per_joint_values(where, joints, list(self.joint_names), None)
        missing = [
            name
            for name, value in zip(self.joint_names, values, strict=True)
            if value is None
        ]
        if missing:
            raise InputError(
                "joints are missing",
                where=where,
                found=", ".join(missing),
                allowed="a position for each",
            )
        q = np.array(values, dtype=float)
        if not np.all(np.abs(q) <= FARTHEST):
            allowed = f"finite numbers, within {FARTHEST:g} rad or m of zero"
            raise InputError(
                "is no posture", where=where, found=q.tolist(), allowed=allowed
            )
        return q

    def place_joints(
        self, q: np.ndarray, qdot: np.ndarray | None = None
    ) -> Iterator[pin.Data]:
        """Give Pinocchio's placements of all joints and of the tool frame, and velocities, posture after posture.

        Parameters
        ----------
        q : (K, n) ndarray
        qdot : (K, n) ndarray, optional

        Yields
        ------
        pin.Data
            One workspace for all: what is kept has to be copied.
        """
        model = self.model
        data = model.createData()
        tool = self.frame_id
        q = np.asarray(q, dtype=float)
        for motion in zip(q, *([] if qdot is None else [qdot]), strict=True):
            pin.forwardKinematics(model, data, *motion)
            pin.updateFramePlacement(model, data, tool)
            yield data

    def tool_placement(self, q: np.ndarray) -> pin.SE3:
        """Placement of the tool frame in the world frame at one posture `q`, (n,)."""
        (data,) = self.place_joints(np.asarray(q)[None])
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
        base = self.model.frames[
            self.model.getFrameId(self.base_frame, pin.FrameType.BODY)
        ].placement
        up = pin.rpy.rpyToMatrix(*np.radians(self.settings.mounting.rpy_deg))[:, 2]
        return np.asarray((self.tool_placements(q)[0] - base.translation) @ up)


def _with_roll(joints: object, n: int) -> object:
    """Add the virtual joint's position, zero, to a posture that leaves it out."""
    if isinstance(joints, Mapping):
        return {ROLL_JOINT: 0.0, **joints}
    if isinstance(joints, (Sequence, np.ndarray)) and len(joints) == n - 1:
        return [*joints, 0.0]
    return joints


def _vector(gravity: Sequence[float]) -> np.ndarray:
    """Gravity as (3,), m/s^2."""
    try:
        vector = np.asarray(gravity, dtype=float)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.all(np.abs(vector) <= LARGEST):
        allowed = f"[x, y, z] in m/s^2, finite, at most {LARGEST:g} in size"
        raise InputError(
            "is not a vector", where="robot.gravity", found=gravity, allowed=allowed
        )
    return vector
