"""The trajectory: evaluation, immutability, precision, and the file."""

import zipfile
from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BPoly

from brachis import Line, examples, robots
from brachis.errors import InputError, ResultFileError
from brachis.planner import plan
from brachis.robot import Robot, dynamics
from brachis.trajectory import Trajectory
from brachis.trajectory.pieces import piece_coefficients
from support.arrays import assert_near
from support.checks import check_of, failed_checks
from support.effort import QUICK
from support.result_files import with_parts


def plan_length(length):
    line = Line(length=length, angle_deg=90)
    return plan(examples.scara_line, path=line, **QUICK)


@pytest.fixture(scope="module")
def trajectory():
    return plan_length(0.3).trajectory


def test_nodes_are_met(trajectory):
    t = trajectory.times
    assert_array_equal(trajectory.position(t[:-1]), trajectory.q[:-1])
    nodes = trajectory.at(t)
    assert_allclose(nodes.q, trajectory.q, rtol=0.0, atol=1e-15)
    assert_allclose(nodes.qdot, trajectory.qdot, rtol=0.0, atol=1e-13)
    assert_near(nodes.qddot, trajectory.qddot, 1e-11)


def test_derivatives_against_differences(trajectory):
    h = 1e-6
    t = np.random.default_rng(1).uniform(h, trajectory.t_end - h, 200)
    before, here, after = (trajectory.at(t + step) for step in (-h, 0.0, h))
    atol = 2e-8 * np.abs(trajectory.qddot).max()
    for lower, upper in (("q", "qdot"), ("qdot", "qddot")):
        difference = (getattr(after, lower) - getattr(before, lower)) / (2.0 * h)
        assert_allclose(difference, getattr(here, upper), rtol=0.0, atol=atol)


@pytest.mark.parametrize("length", [1e-3, 1e-5])
def test_derivatives_of_a_very_short_motion_are_precise(length):
    # Position 2 rad, pieces of 1e-5 or 1e-7 s: coefficients that held 2 rad would give accelerations to 1e-4 only, and
    # the rounding of positions alone would be a jerk of 30 or 3e7 rad/s^3.
    times = np.linspace(0.0, length, 101)[:, None]
    q, qddot = 2.0 + 0.5 * 3.0 * times**2, np.full((101, 1), 3.0)
    coefficients, jerk = piece_coefficients(times[:, 0], q, 3.0 * times, qddot, qddot)
    pieces = BPoly(coefficients, times[:, 0])
    inside = 0.5 * (times[1:] + times[:-1])[:, 0]
    assert_allclose(pieces(inside, nu=2), 3.0, rtol=1e-10)
    assert_allclose(pieces(inside, nu=1)[:, 0], 3.0 * inside, rtol=1e-10)
    assert_allclose(q[:-1, 0] + pieces.c[-1, :, 0], q[1:, 0], rtol=5e-16)
    assert np.abs(jerk).max() < 1e-4 * 3.0 / length


def test_the_jerk_is_the_third_derivative_of_the_positions(trajectory):
    t = np.random.default_rng(3).uniform(0.0, trajectory.t_end, 300)
    jerk = trajectory.jerk(t)
    assert_near(trajectory.pieces(t, nu=3), jerk, 1e-8)


@pytest.mark.parametrize("length", [1e-6, 1e-5, 1e-4])
def test_positions_say_what_they_can_and_no_more(length):
    """An ulp between two nodes is rounding; ten are a jerk."""
    times, still = np.array([0.0, length]), np.zeros((2, 1))

    def jerk(ulps):
        q = np.array([[1.5], [1.5 + ulps * np.spacing(1.5)]])
        return np.abs(piece_coefficients(times, q, still, still, still)[1]).max()

    assert jerk(1) == 0.0
    assert jerk(10) > 5.0 * 60.0 * np.spacing(1.5) / length**3


@pytest.mark.parametrize("length", [1e-3, 1e-4])
def test_very_short_lines_pass_their_checks(length):
    result = plan_length(length)
    assert result.t_end < 0.06
    assert failed_checks(result.verification) == []
    assert check_of(result.verification, "torque jump").value < 1e-10


_HEADERS = (
    b"{'descr': '<f8', 'fortran_order': Fal",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,), \n",
    b"{'descr': '<f8', 1: 2}\n",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000000000000000,)}\n",
    b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}\n",
    b"{'descr': '|O', 'fortran_order': False, 'shape': (1,)}\n",
    b"(" * 3000 + b"\n",
    b"  x\n y\n",
)


@pytest.fixture
def saved_file(trajectory, tmp_path):
    trajectory.save(tmp_path / "result.npz")
    return tmp_path / "result.npz"


@pytest.mark.parametrize("header", _HEADERS)
def test_headers_of_arrays_that_are_broken(header, saved_file):
    with zipfile.ZipFile(saved_file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    length = len(header).to_bytes(2, "little")
    members["times.npy"] = members["times.npy"][:8] + length + header
    with zipfile.ZipFile(saved_file, "w") as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    with pytest.raises(ResultFileError, match="not a brachis result"):
        Trajectory.load(saved_file)


def test_samples(trajectory):
    samples = trajectory.sample(0.01)
    assert samples.t[-1] == trajectory.t_end
    assert_array_equal(samples.t[:-1], 0.01 * np.arange(len(samples.t) - 1))
    assert_array_equal(samples.q, trajectory.position(samples.t))
    assert_allclose(samples.tau, trajectory.torque(samples.t), rtol=1e-12, atol=1e-12)
    assert samples.s[0] == 0.0
    assert samples.s[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(samples.tau).max() == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("divisor", [1, 3, 1000])
def test_periods_that_divide_the_end_time(divisor, trajectory):
    samples = trajectory.sample(trajectory.t_end / divisor)
    assert len(samples.t) == divisor + 1
    assert (np.diff(samples.t) > 0.0).all()


@pytest.mark.parametrize("periods", [0.4, 1.0, 2.5, 999.7])
def test_the_end_posture_is_held_at_the_first_period_that_is_not_before_the_end(
    periods, trajectory
):
    dt = trajectory.t_end / periods
    exact, held = trajectory.sample(dt), trajectory.sample(dt, last="hold")
    assert len(held.t) == int(np.ceil(periods)) + 1
    assert_array_equal(held.t, dt * np.arange(len(held.t)))
    assert held.t[-1] >= trajectory.t_end * (1.0 - 1e-12)
    for field in fields(held):
        before, same = getattr(held, field.name)[:-1], getattr(exact, field.name)[:-1]
        assert_allclose(before, same, rtol=1e-12, atol=1e-12)
    assert held.s[-1] == 1.0
    assert_allclose(held.q[-1], trajectory.position(trajectory.t_end), atol=1e-14)
    assert not held.qdot[-1].any()
    assert not held.qddot[-1].any()


def test_the_torque_that_holds_the_end_posture_is_the_static_one(trajectory):
    robot = Robot.from_urdf(robots.path_of("scara3"), gravity=[0.0, -9.81, 0.0])
    heavy = replace(trajectory, robot=robot)
    held = heavy.sample(0.3, last="hold")
    still = np.zeros((1, 3))
    (lever,) = dynamics.torque(heavy.robot, held.q[-1:], still, still)
    assert np.abs(lever).max() > 10.0
    assert_allclose(held.tau[-1], lever, rtol=1e-12)


def test_unknown_ending(trajectory):
    told = r"no ending named 'held'.*allowed: exact, hold.*Did you mean 'hold'"
    with pytest.raises(InputError, match=told):
        trajectory.sample(0.1, last="held")


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf, 1e-9])
def test_unusable_period(dt, trajectory):
    with pytest.raises(InputError, match="the period is out of range"):
        trajectory.sample(dt)


@pytest.mark.parametrize("beyond", [-1e-3, 1e-3, np.nan])
@pytest.mark.parametrize(
    "curve", ["position", "velocity", "acceleration", "torque", "path_coordinate", "at"]
)
def test_times_outside_are_errors(curve, beyond, trajectory):
    t = np.array([0.1, beyond if beyond < 0.0 else trajectory.t_end + beyond])
    words = "the time is outside the trajectory"
    with pytest.raises(InputError, match=words) as caught:
        getattr(trajectory, curve)(t)
    assert f"{trajectory.t_end:.6g} s" in caught.value.allowed


def test_rounding_at_the_ends_is_forgiven(trajectory):
    end = trajectory.t_end
    rounded = trajectory.position(np.array([-1e-13, end * (1.0 + 1e-13)]))
    assert_array_equal(rounded, trajectory.position(np.array([0.0, end])))


def test_arrays_are_frozen_copies(trajectory):
    q = np.array(trajectory.q)
    copy = replace(trajectory, q=q)
    q += 1.0
    assert_array_equal(copy.q, trajectory.q)
    assert q.flags.writeable
    arrays = [getattr(copy, field.name) for field in fields(copy)]
    arrays = [array for array in arrays if isinstance(array, np.ndarray)]
    assert len(arrays) == 10
    for array in [*arrays, copy.pieces.c, copy.pieces.x]:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_samples_are_frozen_copies(trajectory):
    t = np.linspace(0.0, 0.1, 5)
    samples = trajectory.at(t)
    t[:] = 7.0
    assert samples.t[-1] == 0.1
    for field in fields(samples):
        with pytest.raises(ValueError, match="read-only"):
            getattr(samples, field.name)[...] = 0.0


def test_round_trip(trajectory, saved_file):
    again = Trajectory.load(saved_file)
    for field in fields(trajectory):
        saved, loaded = getattr(trajectory, field.name), getattr(again, field.name)
        if field.name != "robot":
            assert_array_equal(saved, loaded, err_msg=field.name)
    assert again.joint_names == trajectory.joint_names
    for name in ("torque", "velocity"):
        saved, loaded = (
            getattr(motion.robot.limits, name) for motion in (trajectory, again)
        )
        assert_array_equal(saved, loaded)
    t = np.linspace(0.0, trajectory.t_end, 50)
    assert_allclose(trajectory.at(t).tau, again.at(t).tau, rtol=1e-12, atol=1e-12)


def test_file_does_not_need_the_urdf_file(trajectory, saved_file):
    moved = with_parts(saved_file, task__robot__urdf="/nowhere/robot.urdf")
    assert Trajectory.load(moved).joint_names == trajectory.joint_names


def put(place, value):
    def change(array):
        array[place] = value
        return array

    return change


BROKEN = {
    "meta missing": ({"meta": None}, "meta"),
    "meta not JSON": ({"meta": np.array("{")}, "not a brachis result"),
    "other schema": ({"schema": 99}, "unknown schema version; found 99; allowed: 4"),
    "the schema before this one": (
        {"schema": 3, "phase_ends": None},
        "unknown schema version; found 3; allowed: 4. Plan again, or load the file with the release that wrote it",
    ),
    "array missing": ({"qddot": None}, "qddot"),
    "degree a string": ({"degree": "3"}, "degree: wrong type; found '3' (a string)"),
    "degree zero": ({"degree": 0}, "knots of a spline of degree 0"),
    "urdf missing": ({"urdf": None}, "urdf: wrong type"),
    "urdf broken": ({"urdf": "<robot"}, "not well-formed XML"),
    "urdf of another robot": (
        {"urdf": lambda text: text.replace('"j2"', '"elbow"')},
        "joint_names: the joints are not those",
    ),
    "task missing": ({"task": None}, "task: wrong type"),
    "task wrong": ({"task__spline__degree": "three"}, "spline.degree"),
    "task of another robot": ({"task__start__joints": [0.1, 0.2]}, "task.start.joints"),
    "redundant joint unknown": (
        {"redundant_joints": ["j9"]},
        "redundant_joints: unknown joints",
    ),
    "more redundant joints": (
        {"redundant_joints": ["j1", "j3"]},
        "control_points: wrong shape",
    ),
    "branch a number": ({"branch": 1}, "branch: wrong type"),
    "times descending": ({"times": lambda a: a[::-1]}, "times: not times"),
    "times NaN": ({"times": put(3, np.nan)}, "times: some numbers are not finite"),
    "times objects": (
        {"times": np.array([None, {}], dtype=object)},
        "not a brachis result",
    ),
    "knots descending": ({"knots": lambda a: a[::-1]}, "knots: not the knots"),
    "knots too close": (
        {"knots": lambda a: np.sort(put(5, a[4] + 1e-14)(a))},
        "knots: internal knots are repeated",
    ),
    "q too large": (
        {"q": put((3, 1), 1e300)},
        "q: some numbers are not finite or are too large",
    ),
    "too many times": (
        {"times": np.linspace(0.0, 1.0, 500_001)},
        "times: the motion has too many nodes; found 500001",
    ),
    "phases end elsewhere": (
        {"phase_ends": lambda a: 0.5 * a},
        "phase_ends: not the ends of the phases",
    ),
    "q of fewer nodes": ({"q": lambda a: a[1:]}, "q: wrong shape"),
    "fewer control points": (
        {"control_points": lambda a: a[:, 1:]},
        "control_points: wrong shape",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_file(case, saved_file):
    parts, expected = BROKEN[case]
    with_parts(saved_file, **parts)
    with pytest.raises(ResultFileError) as caught:
        Trajectory.load(saved_file)
    assert str(caught.value).startswith(f"{saved_file}: ")
    assert expected in str(caught.value)
    assert caught.value.exit_code == 2


def cut(path):
    path.write_bytes(path.read_bytes()[:-100])


def empty(path):
    path.write_bytes(b"")


def flip_a_byte(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))


def single_array(path):
    with path.open("wb") as stream:
        np.save(stream, np.zeros(3))


def zip_of_text(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("meta", "{}")


def not_an_array(path):
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("q", b"no array")


def blown_up(path):
    with zipfile.ZipFile(path, "a", compression=zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros.npy", bytes(140_000_000))
    assert path.stat().st_size < 1_000_000


@pytest.mark.parametrize(
    "spoil",
    [cut, flip_a_byte, single_array, zip_of_text, not_an_array, blown_up, empty],
)
def test_file_of_another_kind(spoil, saved_file):
    spoil(saved_file)
    with pytest.raises(ResultFileError, match="not a brachis result") as caught:
        Trajectory.load(saved_file)
    assert caught.value.where == str(saved_file)


def test_a_fault_of_our_own_is_not_taken_for_a_broken_file(saved_file, monkeypatch):
    monkeypatch.delattr("brachis.trajectory.result_file.ARRAYS")
    with pytest.raises(NameError):
        Trajectory.load(saved_file)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ResultFileError, match="the file does not exist"):
        Trajectory.load(tmp_path / "gone.npz")
    with pytest.raises(ResultFileError, match=r"not a brachis result.*a folder"):
        Trajectory.load(tmp_path)


def test_no_time_and_derivatives_beyond_the_degree(trajectory):
    assert trajectory.position([]).shape == (0, trajectory.robot.n)
    assert trajectory.jerk([]).shape == (0, trajectory.robot.n)
    assert not trajectory.pieces([0.0, 0.1], nu=6).any()
