"""Joint limits: where they come from, in which forms they are given, and what is refused."""

from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis import LimitSpec
from brachis.errors import InputError, LimitError, TaskError, UnknownNameError
from brachis.robot import Robot
from brachis.robot.from_task import robot_from_settings
from brachis.robot.limits import to_spec
from brachis.task import FROM_URDF, LIMIT_KINDS, ROBOT_LIMITS, LimitKeywords
from brachis.task.units import unit_of
from support.chains import Joint, chain_urdf, planar_robot

INF = np.inf


def limits_of(**spec):
    """Limits of a robot whose URDF says 80, 70, 60 Nm and 3.0, 3.1, 3.2 rad/s."""
    return planar_robot("RRR", limits=LimitSpec(**spec)).limits


def with_limit(limits=None, **changes):
    limit = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "effort": 1.0, **changes}
    limit = {key: value for key, value in limit.items() if value is not None}
    joints = [Joint("revolute"), Joint("revolute", limit=limit)]
    text = chain_urdf(joints, tool=(0.3, 0.0, 0.0))
    return Robot.from_urdf("file.urdf", urdf_text=text, limits=limits)


@pytest.mark.parametrize(
    "value, expected",
    [
        (FROM_URDF, [80.0, 70.0, 60.0]),
        (12.5, [12.5, 12.5, 12.5]),
        ((1.0, None, FROM_URDF), [1.0, INF, 60.0]),
        (np.array([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]),
        (np.float32(12.5), [12.5, 12.5, 12.5]),
        ({"j2": np.int64(5)}, [80.0, 5.0, 60.0]),
        ({"j3": None, "j1": 7}, [7.0, 70.0, INF]),
        (None, [INF, INF, INF]),
    ],
    ids=str,
)
def test_forms_of_a_limit(value, expected):
    assert_array_equal(limits_of(torque=value, acceleration=9.0).torque, expected)


@pytest.mark.parametrize(
    "value, lower, upper",
    [
        (FROM_URDF, [-3.0] * 3, [2.9] * 3),
        (None, [-INF] * 3, [INF] * 3),
        ({"j1": [-1.0, 1.0], "j3": None}, [-1.0, -3.0, -INF], [1.0, 2.9, INF]),
        ([[-1.0, 1.0], None, FROM_URDF], [-1.0, -INF, -3.0], [1.0, INF, 2.9]),
        (np.array([[-1.0, 1.0]] * 3), [-1.0] * 3, [1.0] * 3),
    ],
    ids=str,
)
def test_forms_of_a_range(value, lower, upper):
    limits = limits_of(position=value)
    assert_array_equal(limits.position_lower, lower)
    assert_array_equal(limits.position_upper, upper)


def test_scale_comes_last():
    limits = limits_of(
        torque=10.0,
        acceleration=4.0,
        scale={"torque": 0.5, "velocity": 0.1, "acceleration": 0.25},
    )
    assert_allclose(limits.torque, 5.0)
    assert_allclose(limits.velocity, [0.3, 0.31, 0.32])
    assert_allclose(limits.acceleration, 1.0)
    free = limits_of(torque=None, acceleration=1.0, scale={"torque": 0.5})
    assert_array_equal(free.torque, INF)


@pytest.mark.parametrize(
    "changes, kind", [({"effort": -1.0}, "torque"), ({"velocity": 0.0}, "velocity")]
)
def test_limit_of_the_urdf_that_is_not_positive(changes, kind):
    key = f"robot.limits.{kind}.j2"
    words = f"{kind} limit in the URDF is not positive.*Set {key} in the task file"
    with pytest.raises(LimitError, match=words) as caught:
        with_limit(**changes)
    assert (caught.value.joint, caught.value.key) == ("j2", key)


@pytest.mark.parametrize("factors", [2.0, "half", [1.0]])
def test_a_scale_that_is_no_mapping(factors):
    with pytest.raises(InputError, match=r"limits\.scale: .* allowed: a mapping"):
        limits_of(scale=factors)


def test_what_a_program_says_of_limits_is_what_a_task_keeps():
    given = {
        "torque": np.array([1.0, 2.0, 3.0]),
        "position": {"j1": np.array([-1.0, 1.0])},
        "scale": {"velocity": 0.5},
    }
    robot = planar_robot("RRR", limits=LimitSpec(**given))
    assert robot.settings.limits == LimitSpec(
        **given | {"torque": {"j1": 1.0, "j2": 2.0, "j3": 3.0}}
    )
    again = robot_from_settings(robot.settings, urdf_text=robot.urdf)
    assert again.settings.limits == robot.settings.limits
    assert_array_equal(again.limits.torque, robot.limits.torque)


@pytest.mark.parametrize(
    "wrong",
    [{"torque": True}, {"acceleration": np.inf}, {"scale": {"torque": True}}],
    ids=str,
)
def test_what_a_task_could_not_keep_is_an_error(wrong):
    with pytest.raises(TaskError, match=f"limits.{next(iter(wrong))}"):
        limits_of(**wrong)


def test_infinite_figures_in_lists_leave_limits_open():
    free = limits_of(velocity=[1.0, np.inf, None])
    assert_array_equal(free.velocity, [1.0, np.inf, np.inf])


def key_of_the_error(words, **spec):
    with pytest.raises(LimitError, match=words) as caught:
        limits_of(**spec)
    return caught.value.key


def test_a_limit_that_scaling_would_mend_is_an_error():
    with pytest.raises(LimitError, match="torque limit is too small or too large"):
        limits_of(torque={"j3": 1e13}, scale={"torque": 1e-3})


def test_neither_torque_nor_acceleration():
    with pytest.raises(LimitError, match="neither a torque nor an accel") as caught:
        limits_of(torque={"j2": None})
    assert caught.value.joint == "j2"
    assert caught.value.key == "robot.limits.acceleration.j2 or robot.limits.torque.j2"
    assert limits_of(torque={"j2": None}, acceleration={"j2": 5.0}).torque[1] == INF
    with pytest.raises(LimitError) as caught:
        limits_of(torque=None)
    assert caught.value.key == "robot.limits.acceleration or robot.limits.torque"


@pytest.mark.parametrize("effort", [None, 0.0])
def test_urdf_without_effort(effort):
    words = (
        "neither a torque nor an acceleration.*an effort of 0 in the URDF is no limit"
    )
    with pytest.raises(LimitError, match=words) as caught:
        with_limit(effort=effort)
    assert caught.value.joint == "j2"
    loose = with_limit(effort=effort, limits={"acceleration": {"j2": 5.0}})
    assert loose.limits.torque[1] == INF


def test_unknown_joint_with_suggestion():
    with pytest.raises(UnknownNameError, match=r"Did you mean 'j2'\?") as caught:
        limits_of(velocity={"j22": 1.0})
    assert caught.value.where == "robot.limits.velocity"


@pytest.mark.parametrize("kind", ["torque", "velocity", "acceleration", "position"])
def test_wrong_length(kind):
    value = [[-1.0, 1.0]] * 2 if kind == "position" else [1.0, 2.0]
    with pytest.raises(InputError) as caught:
        limits_of(**{kind: value})
    message = f"robot.limits.{kind}: the list has the wrong number of values"
    assert str(caught.value).startswith(f"{message}; found 2; allowed: 3")


def test_an_empty_range_of_the_urdf_or_the_task_is_an_error():
    with pytest.raises(LimitError, match="position range is empty"):
        with_limit(lower=1.0, upper=0.5)
    with pytest.raises(LimitError, match="position range is empty"):
        limits_of(position={"j1": [0.5, 0.5 + 1e-12]})


def test_coulomb_friction_that_no_torque_overcomes_is_an_error():
    friction = {"coulomb": {"j2": 90.0}}
    with pytest.raises(InputError, match="Coulomb friction of joint 'j2' is not below"):
        planar_robot("RR", friction=friction)
    strong = LimitSpec(torque={"j2": 100.0})
    robot = planar_robot("RR", friction=friction, limits=strong)
    assert robot.friction.coulomb[1] == 90.0


@pytest.mark.parametrize("value", [1e-308, 1e-7, 1e13])
@pytest.mark.parametrize("kind", ["torque", "velocity", "acceleration"])
def test_limits_that_no_drive_has_are_errors(kind, value):
    words = (
        f"{kind} limit is too small or too large; found .* 1e-06 to 1e.12 in SI units"
    )
    key = key_of_the_error(words, **{kind: {"j3": value}})
    assert key == f"robot.limits.{kind}.j3"


@pytest.mark.parametrize("factor", [1e-9, 1e12, 1e308])
@pytest.mark.parametrize("kind", ["torque", "velocity", "acceleration"])
def test_scaled_limits_that_no_drive_has_are_errors(kind, factor):
    words = f"scaled {kind} limit is too small or too large"
    key = key_of_the_error(words, acceleration=9.0, scale={kind: factor})
    assert key == f"robot.limits.scale.{kind}"


def test_limits_at_the_bounds_are_taken():
    limits = limits_of(
        velocity=1e-6, torque=1e12, position={"j1": [-1e6, 1e6], "j2": [0.2, None]}
    )
    assert_array_equal(limits.velocity, 1e-6)
    assert_array_equal(limits.torque, 1e12)
    assert limits.position_upper[1] == INF


@pytest.mark.parametrize("pair", [[-1e7, 1.0], [None, 1e10]])
def test_ranges_that_end_too_far_away_are_errors(pair):
    words = r"position range is too far from zero.*null for an open end"
    key = key_of_the_error(words, position={"j1": pair})
    assert key == "robot.limits.position.j1"


@pytest.mark.parametrize("pair", [[0.2, 1e300], [None, 1e16]])
def test_ranges_that_a_task_cannot_state_are_errors(pair):
    with pytest.raises(TaskError, match=r"limits\.position\.j1\[1\]: out of range"):
        limits_of(position={"j1": pair})


@pytest.mark.parametrize(
    "friction, where",
    [
        ({"coulomb_velocity": 1e-308}, "robot.friction.coulomb_velocity"),
        ({"armature": 1e300}, "robot.friction.armature.j1"),
    ],
)
def test_friction_that_no_drive_has_is_an_error(friction, where):
    with pytest.raises(InputError) as caught:
        planar_robot("RR", friction=friction)
    assert caught.value.where == where


def test_positions_and_gravity_that_no_robot_has_are_errors():
    with pytest.raises(InputError, match="a joint position is out of range"):
        planar_robot("CC").posture([1e300, 0.0], "start.joints")
    with pytest.raises(InputError, match=r"robot: gravity\[2\]: out of range"):
        planar_robot("RR", gravity=[0.0, 0.0, -1e300])
    with pytest.raises(InputError, match=r"robot\.locked_joints\.j2"):
        planar_robot("RR", locked_joints={"j2": 1e7})


@pytest.mark.parametrize(
    "value, lower, upper",
    [
        ({"j2": [-5.0, 7.0]}, [-80.0, -5.0, -60.0], [80.0, 7.0, 60.0]),
        ([[-5.0, 7.0], 9.0, None], [-5.0, -9.0, -INF], [7.0, 9.0, INF]),
    ],
    ids=str,
)
def test_pairs_of_limits(value, lower, upper):
    robot = planar_robot(
        "RRR", limits=LimitSpec(torque=value, acceleration=9.0, scale={"torque": 0.5})
    )
    assert_array_equal(robot.limits.torque_lower, 0.5 * np.array(lower))
    assert_array_equal(robot.limits.torque_upper, 0.5 * np.array(upper))
    assert_array_equal(robot.limits.torque, 0.5 * np.minimum(upper, -np.array(lower)))
    again = robot_from_settings(robot.settings, urdf_text=robot.urdf)
    assert_array_equal(again.limits.torque_lower, robot.limits.torque_lower)


@pytest.mark.parametrize(
    "pair", [[1.0], [1.0, 2.0], [-2.0, -1.0], [-1.0, 0.0], [-1.0, None]], ids=str
)
def test_pairs_that_are_none_around_zero(pair):
    with pytest.raises(TaskError, match=r"robot: limits\.torque\.j2"):
        limits_of(torque={"j2": pair})
    with pytest.raises(TaskError, match=r"robot: limits\.acceleration\.j2: wrong type"):
        limits_of(acceleration={"j2": [-1.0, 1.0]})


FIELDS = [entry.name for entry in fields(LimitSpec) if entry.name != "scale"]
STATED = {
    **dict.fromkeys([*LIMIT_KINDS, *ROBOT_LIMITS], 7.0),
    "position": [[-1.0, 1.0]] * 3,
    "torque_speed": {"j1": [[0.0, 7.0], [1.0, 5.0]]},
}


@pytest.mark.parametrize("name", FIELDS)
def test_every_limit_survives_when_it_is_stated_joint_by_joint(name):
    assert name in STATED, "STATED of this file has no value for this limit"
    names = ["j1", "j2", "j3"]
    without = to_spec(limits_of(acceleration=9.0), names)
    stated = {"acceleration": 9.0, name: STATED[name]}
    spec = to_spec(limits_of(**stated), names)
    assert getattr(spec, name) != getattr(without, name)
    assert to_spec(limits_of(**vars(spec)), names) == spec


def test_every_limit_is_a_keyword_and_has_a_unit():
    assert set(LimitKeywords.__annotations__) == {*FIELDS, "scale"}
    units = {name: unit_of(f"robot.limits.{name}") for name in FIELDS}
    del units["torque_speed"]  # a table of speeds and torques
    assert all(units.values()), units
