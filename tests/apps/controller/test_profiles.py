"""Axes and units of the included profiles, against values written by hand; profiles of the user's own."""

import csv

import numpy as np
import pytest

import brachis
from brachis.apps.controller import bind_axes, robot_with_profile
from brachis.errors import InputError
from support.controllers import RAIL_START

DEGREES = np.degrees(RAIL_START[1:])


def read_table(path):
    """Read the header and the rows of a table."""
    header, *rows = csv.reader(path.read_text().splitlines())
    return header, np.array(rows, dtype=float)


ARM = {"kuka_rsi_4ms": "A", "abb_egm_4ms": "J", "fanuc_stream_8ms": "J"}
RAIL = {"kuka_rsi_4ms": "E1", "abb_egm_4ms": "eax_a", "fanuc_stream_8ms": "E1"}


@pytest.mark.filterwarnings("ignore:FANUC.*torque ratio")  # by rounding
@pytest.mark.parametrize("profile", ARM)
def test_a_rail_by_250_mm_and_a_joint_by_90_degrees_are_right(profile, turn, tmp_path):
    path = tmp_path / "run.csv"
    brachis.export.write_for_controller(turn, path, profile)
    header, rows = read_table(path)
    arm = [f"q_{ARM[profile]}{number} [deg]" for number in range(1, 7)]
    assert header == ["t", *arm, f"q_{RAIL[profile]} [mm]"]
    first = DEGREES.copy()
    change = np.array([90.0, 30.0, 0.0, 0.0, 0.0, 0.0])
    if profile == "fanuc_stream_8ms":  # J3 is measured from the horizontal
        first[2] -= first[1]
        change[2] -= 30.0
    digits = 1e-5 if profile == "fanuc_stream_8ms" else 1e-8
    np.testing.assert_allclose(rows[0, 1:], [*first, 0.0], atol=digits)
    np.testing.assert_allclose(
        rows[-1, 1:] - rows[0, 1:], [*change, 250.0], atol=2 * digits
    )
    period = rows[1, 0]
    assert period == {"fanuc_stream_8ms": 0.008}.get(profile, 0.004)
    np.testing.assert_allclose(np.diff(rows[:, 0]), period, atol=1e-12)


def test_arms_without_a_rail_keep_radians(seven, tmp_path):
    with pytest.warns(brachis.export.RunWarning, match="acceleration by differences"):
        brachis.export.write_for_controller(seven, tmp_path / "run.csv", "franka_1khz")
    header, rows = read_table(tmp_path / "run.csv")
    assert header == ["t", *(f"q_joint_{number}" for number in range(1, 8))]
    np.testing.assert_allclose(rows[0, 1:], seven.q[0], atol=0)
    np.testing.assert_allclose(rows[-1, 1:], seven.q[-1], atol=1e-12)
    assert rows[1, 0] == 0.001


def test_ros_2_gets_joints_of_the_urdf_in_si_units(turn, tmp_path):
    yaml = pytest.importorskip("yaml")
    path = tmp_path / "run.yaml"
    assert brachis.export.write_for_controller(
        turn, path, "ros2_control", dt=1.25e-3
    ).passed
    message = yaml.safe_load(path.read_text())
    assert message["joint_names"] == [*(f"joint_{n}" for n in range(1, 7)), "rail"]
    last = message["points"][-1]["positions"]
    change = np.subtract(last, [*RAIL_START[1:], 0.0])
    np.testing.assert_allclose(
        change, [np.pi / 2, np.pi / 6, 0, 0, 0, 0, 0.25], atol=1e-12
    )


def own_profile(folder, text):
    """Write a profile that extends KUKA's."""
    path = folder / "cell.yaml"
    path.write_text("extends: kuka_rsi_4ms\n" + text)
    return path


def test_signs_zeros_and_order_of_a_profile_of_ones_own_hold(turn, tmp_path):
    axes = "".join(
        f"  - {{joint: joint_{number}, sign: -1, zero: 0.5}}\n"
        for number in range(1, 7)
    )
    rail = "  - {joint: rail, external: true, name: TRACK, zero: -1.0}\n"
    path = own_profile(tmp_path, f"axes:\n{rail}{axes}")
    axes = bind_axes(brachis.load_profile(path), turn.robot)
    assert axes.names == ("TRACK", "A1", "A2", "A3", "A4", "A5", "A6")
    values = axes.encode(turn.q[:1])[0]
    expected = [1000.0, *-np.degrees(np.array(RAIL_START[1:]) - 0.5)]
    np.testing.assert_allclose(values, expected, atol=1e-12)
    np.testing.assert_allclose(
        axes.decode(axes.encode(turn.q)), turn.q[:, axes.index], atol=1e-14
    )


def test_the_forearm_of_a_fanuc_keeps_its_j3_while_it_stays_level(tmp_path):
    """J2 leans forward, J3 raises the forearm: as much of both leaves it level."""
    path = tmp_path / "cell.yaml"
    joints = ", ".join(f"{{joint: joint_{n}}}" for n in (1, 2))
    path.write_text(
        f"extends: fanuc_stream_8ms\naxes: [{joints}, {{joint: joint_3, sign: -1}}]\n"
    )
    robot = brachis.robots.tx90l_rail
    q = np.zeros((2, 7))
    q[1, 2:4] = [0.4, -0.4]  # both turn about y: the forearm stays level
    values = bind_axes(brachis.load_profile(path), robot).encode(q)
    change = [0, np.degrees(0.4), 0]
    np.testing.assert_allclose(values[1] - values[0], change, atol=1e-12)


def test_a_model_without_a_coupling_says_so(tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text("extends: fanuc_stream_8ms\ncoupled: {J3: {J2: 0}}\n")
    matrix = bind_axes(brachis.load_profile(path), brachis.robots.tx90l_rail).matrix
    np.testing.assert_array_equal(matrix, np.diag(np.diag(matrix)))


SWAPPED = "axes: [{joint: joint_2}, {joint: joint_1}, {joint: rail, external: true}]"
REFUSED = {
    "axes: [{joint: joint_1}]": "moves has no axis in the profile; found rail, joint_2",
    SWAPPED: "not in the order of the chain; found joint_2, joint_1; allowed: joint_1, joint_2",
    "axes: [{joint: joint_7}]": "no joint named 'joint_7'",
    "axes: [{joint: rail, external: true}, {joint: rail}]": "joint 'rail' is given twice",
    "arm: {names: [A1, A2]}": "too few names for axes of the arm; found joint_1",
    "coupled: {A3: {A9: 1}}": "no axis named 'A9'",
    "arm: {names: [A1, A1, A3, A4, A5, A6]}": "axis 'A1' is given twice",
    "coupled: {A3: {A3: -1}}": "the axes do not determine the joints",
    "limits: {total_power: 5}": "a profile cannot contain this limit",
    "period: 4": "period: out of range; found 4; allowed: <= 0.1",
    "formats: [krl]": "no format of samples named 'krl'",
    "axes: [{joint: joint_1, zero: 90}]": "zero of an axis is more than a turn away; found 90 rad",
    "events: {process_start: x}": "no event with this name",
    "limits: {velocity: [1, 2]}": "wrong number of values; found 2; allowed: 6, for the arm; limits of external axes",
}


@pytest.mark.parametrize("text", REFUSED)
def test_profiles_that_do_not_fit_are_refused(text, turn, tmp_path):
    path = own_profile(tmp_path, text)
    with pytest.raises(InputError) as caught:
        brachis.export.write_for_controller(turn, tmp_path / "run.csv", path)
    assert REFUSED[text] in str(caught.value)
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.parametrize(
    "options, message",
    [
        ({"dt": 0.001}, "not accept this period; found 0.001 s; allowed: 0.004 s"),
        ({"moves": "linear"}, "samples have no moves"),
        (
            {"form": "json"},
            "no format of KUKA.* named 'json'; allowed: csv, program",
        ),
        ({"form": "program", "moves": "round"}, "no kind of moves named 'round'"),
        (
            {"form": "program", "time_tolerance": 1e-15},
            "no program of positions is within.*Raise time_tolerance",
        ),
    ],
)
def test_options_that_a_controller_cannot_take_are_refused(
    options, message, turn, tmp_path
):
    with pytest.raises(InputError, match=message):
        brachis.export.write_for_controller(
            turn, tmp_path / "a.csv", "kuka_rsi_4ms", **options
        )


def test_every_profile_loads_and_names_its_sources():
    profiles = [brachis.load_profile(name) for name in brachis.profile_names()]
    assert len(profiles) == 7
    for profile in profiles:
        assert all(len(source) > 20 for source in profile.sources)
    with pytest.raises(InputError, match="Did you mean 'kuka_rsi_4ms'"):
        brachis.load_profile("kuka_rsi_4m")


def test_degrees_and_mm_are_named_in_the_header(turn, tmp_path):
    brachis.export.write(turn, tmp_path / "run.csv", degrees=True, mm=True)
    header, rows = read_table(tmp_path / "run.csv")
    assert header[1:3] == ["q_rail [mm]", "q_joint_1 [deg]"]
    assert header[8:10] == ["qd_rail [mm/s]", "qd_joint_1 [deg/s]"]
    np.testing.assert_allclose(rows[-1, 1:3], [250.0, DEGREES[0] + 90.0], atol=1e-9)
    np.testing.assert_allclose(
        rows[:, 9], np.degrees(turn.velocity(rows[:, 0])[:, 1]), atol=1e-9
    )


def test_ros_2_refuses_degrees(turn, tmp_path):
    with pytest.raises(InputError, match="needs rad and m; found m, deg"):
        brachis.export.write(turn, tmp_path / "run.yaml", degrees=True)
    assert not (tmp_path / "run.yaml").exists()


def test_torques_of_axes_do_the_work_of_those_of_the_joints(turn, tmp_path):
    arm = "".join(f"  - {{joint: joint_{n}, sign: -1}}\n" for n in range(1, 7))
    rail = "  - {joint: rail, external: true}\n"
    path = own_profile(tmp_path, f"axes:\n{arm}{rail}coupled: {{A3: {{A2: 0.5}}}}\n")
    axes = bind_axes(brachis.load_profile(path), turn.robot)
    states = turn.at(np.linspace(0.1, 0.4, 5))
    rates = axes.encode_rates(states.qdot) / [*[180.0 / np.pi] * 6, 1e3]
    power = np.sum(axes.encode_torques(states.tau) * rates, axis=1)
    np.testing.assert_allclose(
        power, np.sum(states.tau * states.qdot, axis=1), rtol=1e-12
    )


def test_limits_of_a_profile_keep_the_margins_of_the_task(turn, tmp_path):
    path = own_profile(tmp_path, "limits: {velocity: 1.0}")
    robot = turn.robot.with_limits(scale={"velocity": 0.5})
    profile = brachis.load_profile(path)
    stricter = robot_with_profile(robot, profile, bind_axes(profile, robot))
    assert stricter.limits.velocity[1:].tolist() == [0.5] * 6
    assert stricter.limits.velocity_lower[1:].tolist() == [-0.5] * 6
    assert stricter.limits.velocity[0] == robot.limits.velocity[0]


def test_velocities_of_coupled_axes_are_coupled(turn, tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text("extends: fanuc_stream_8ms\ncolumns: [q, qd]\ndecimals: 9\n")
    brachis.export.write_for_controller(turn, tmp_path / "run.csv", path)
    header, rows = read_table(tmp_path / "run.csv")
    qdot = np.degrees(turn.velocity(rows[:-1, 0]))
    column = header.index("qd_J3 [deg/s]")
    np.testing.assert_allclose(rows[:-1, column], qdot[:, 3] - qdot[:, 2], atol=1e-9)


def test_a_motion_that_goes_on_at_its_end_is_refused(tmp_path):
    result = brachis.plan(
        brachis.examples.scara_line, end_speed=0.3, effort="single", intervals=8
    )
    for file in ("run.csv", "run.src"):
        with pytest.raises(InputError, match="must start and end at rest"):
            result.export(tmp_path / file, profile="kuka_rsi_4ms")
    with pytest.raises(InputError, match="must start and end at rest"):
        brachis.plan_for_controller("kuka_rsi_4ms", result.task)


@pytest.mark.parametrize(
    "template, message",
    [("{% if %}", "Expected an expression"), ("{{nme}}", "'nme' is undefined")],
)
def test_a_wrong_template_is_an_error(template, message, turn, tmp_path):
    path = own_profile(tmp_path, f"program: {{template: '{template}'}}")
    with pytest.raises(InputError, match=message):
        brachis.export.write_for_controller(turn, tmp_path / "run.src", path)


def test_a_list_of_limits_is_for_the_arm_and_a_mapping_for_all_axes(turn, tmp_path):
    values = [1.0, 1.1, 1.2, 1.3, 1.4, 1.5]
    by_joint = "{joint_1: 0.9, rail: 0.4}"
    expected = {str(values): values, by_joint: [0.9]}
    for text, arm in expected.items():
        path = own_profile(tmp_path, f"limits: {{velocity: {text}}}")
        profile = brachis.load_profile(path)
        axes = bind_axes(profile, turn.robot)
        stricter = robot_with_profile(turn.robot, profile, axes).limits.velocity
        np.testing.assert_allclose(stricter[1 : 1 + len(arm)], arm)
    assert stricter[0] == 0.4
