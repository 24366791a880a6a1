"""Programs of positions, read by parsers and run by a simulation that share nothing with the writers."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import brachis
from support.controllers import BLEND, RAIL_START, deviation
from support.effort import QUICK

NUMBER = r"(-?\d+\.?\d*(?:e-?\d+)?)"


def numbers(text):
    """List the numbers of a text."""
    return [float(word) for word in re.findall(NUMBER, text)]


def read_krl(text):
    """Axes A1 to A6 and E1; no times."""
    targets = re.findall(r"E6AXIS: ([^}]*)}", text)
    rows = [dict(re.findall(rf"([AE]\d) {NUMBER}", target)) for target in targets]
    return np.array(
        [
            [float(row[f"A{n}"]) for n in range(1, 7)] + [float(row["E1"])]
            for row in rows
        ]
    ), None


def read_rapid(text):
    """Axes of jointtargets in the order of the moves, and their times."""
    targets = {
        name: numbers(arm) + numbers(rail.replace("9E9", ""))
        for name, arm, rail in re.findall(
            r"jointtarget (p\d+):=\[\[([^]]*)\],\[([^]]*)\]\]", text
        )
    }
    moves = re.findall(r"Move(?:AbsJ|L CalcRobT\()\s?\(?(p\d+)[^;]*;", text)
    times = [0.0, *map(float, re.findall(rf"\\T:={NUMBER}", text))]
    return np.array([targets[name] for name in moves]), np.array(times)


def read_tp(text):
    """Axes of the positions in the order of the moves, and their times."""
    blocks = re.findall(r"P\[(\d+)\]\{(.*?)\};", text, re.DOTALL)
    positions = {
        number: [
            float(value) for _, value in re.findall(rf"([JE]\d) = {NUMBER}", block)
        ]
        for number, block in blocks
    }
    moves = re.findall(r"[JL] P\[(\d+)\] (\d+)(%|msec)", text)
    times = [0.0 if unit == "%" else 1e-3 * float(time) for _, time, unit in moves]
    return np.array([positions[number] for number, _, _ in moves]), np.array(times)


def read_val3(text):
    """Axes of the positions that are moved to."""
    code = re.search(r"<!\[CDATA\[(.*)\]\]>", text, re.DOTALL)[1]
    assert ET.fromstring(text).find(".//{*}Code").text == code  # noqa: S314  (our own text)
    return np.array(
        [numbers(row) for row in re.findall(r"jTarget=\{([^}]*)\}", code)]
    ), None


def read_ur(text):
    """Joints of the moves, and their times."""
    rows = re.findall(r"move[jl]\(\[([^]]*)\]", text)
    times = [0.0, *map(float, re.findall(rf"t={NUMBER}", text))]
    return np.array([numbers(row) for row in rows]), np.array(times)


READERS = {
    "kuka_rsi_4ms": (".src", read_krl),
    "abb_egm_4ms": (".mod", read_rapid),
    "fanuc_stream_8ms": (".ls", read_tp),
    "staubli_val3": (".pgx", read_val3),
    "ur_servoj_500hz": (".script", read_ur),
}


@pytest.fixture(scope="module")
def six():
    """A line of the tool of six joints; its second half at a process speed."""
    robot = brachis.robots.tx90l_rail
    return brachis.plan(
        robot,
        path=[
            {"line": {"by": [0.0, 0.1, 0.0]}},
            {"line": {"by": [0.0, 0.1, 0.0]}, "speed": 0.2},
        ],
        start=RAIL_START[1:],
        task_space="pose",
        search=QUICK,
        locked_joints={"rail": 0.0},
    ).trajectory


def write(motion, profile, folder, **options):
    """Write a program; return its text and how far it is from the motion."""
    path = folder / f"seam{READERS[profile][0]}"
    report = brachis.export.write_for_controller(
        motion, path, profile, form="program", **options
    )
    return path.read_text(), report


def axes_of(motion, profile, q):
    """Positions of the axes by hand: degrees, mm, the arm first; FANUC's J3 from the horizontal."""
    names = motion.joint_names
    arm = [i for i, name in enumerate(names) if name != "rail"]
    values = q[:, arm] if profile == "ur_servoj_500hz" else np.degrees(q[:, arm])
    if profile == "fanuc_stream_8ms":
        values[:, 2] -= values[:, 1]
    rail = [1e3 * q[:, i : i + 1] for i, name in enumerate(names) if name == "rail"]
    return np.hstack([values, *rail])


@pytest.mark.parametrize("moves", ["joint", "linear"])
@pytest.mark.parametrize("profile", READERS)
def test_positions_and_times_are_those_of_the_motion(
    profile, moves, six, seam, tmp_path
):
    motion = six if profile in ("staubli_val3", "ur_servoj_500hz") else seam
    text, report = write(motion, profile, tmp_path, moves=moves)
    positions, durations = READERS[profile][1](text)
    assert len(positions) == report.positions
    dense = np.linspace(0.0, motion.t_end, 20_001)
    values = axes_of(motion, profile, motion.position(dense))
    scale = np.ptp(values, axis=0).max()
    rows = [np.argmin(np.abs(values - row).max(axis=1)) for row in positions]
    np.testing.assert_allclose(values[rows], positions, atol=2e-4 * scale)
    if durations is not None:
        digits = 1e-3 if profile == "fanuc_stream_8ms" else 2e-4
        np.testing.assert_allclose(
            np.cumsum(durations), dense[rows], atol=digits * len(rows)
        )


TOOL = brachis.robots.tx90l_rail.tool_placements(np.array([RAIL_START]))[0][0]
CENTER = np.add(TOOL, [0.1, 0.1, 0.0])


@pytest.fixture(scope="module")
def bend():
    """A line and an arc of the tool, with a dwell between them."""
    return brachis.plan(
        "tx90l_rail",
        path=[
            {"line": {"by": [0.0, 0.1, 0.0]}, "stop": True, "dwell": 0.2},
            {"arc": {"center": CENTER.tolist(), "angle_deg": -60, "normal": [0, 0, 1]}},
        ],
        start=RAIL_START,
        task_space="pose",
        search=QUICK,
    ).trajectory


WAIT = rf"(?:WAIT SEC |WaitTime |WAIT ){NUMBER}"


def read_steps(text, profile, largest):
    """Postures (rail first), times and rests of a program, as its instructions say, in m, rad and s."""
    positions = iter(READERS[profile][1](text)[0])
    nodes, durations, rests = [], [], []
    percent = 100.0
    speed = None
    for line in text.splitlines():
        if found := re.search(r"VEL_AXIS\[I\] = (\d+)", line):
            percent = float(found[1])
        elif found := re.search(rf"VEL.CP = {NUMBER}", line):
            speed = float(found[1])
        elif found := re.search(WAIT, line):
            nodes.append(nodes[-1])
            durations.append(float(found[1]))
            rests.append(True)
        elif re.search(r"\b(MoveAbsJ|MoveL|PTP|LIN|[JL] P)\b", line):
            row = next(positions)
            posture = np.append(1e-3 * row[6], np.radians(row[:6]))
            if profile == "fanuc_stream_8ms":
                posture[3] += posture[2]
            nodes.append(posture)
            rests.append(not re.search(r"\\Z:=|CNT100|C_PTP|C_DIS", line))
            found = re.search(rf"T:={NUMBER}|{NUMBER}msec", line)
            duration = 0.0
            if len(nodes) == 1:
                rests[0] = True
            elif found:
                duration = float(found[1] or 1e-3 * float(found[2]))
            else:
                ends = nodes[-2:]
                moved = np.abs(ends[1] - ends[0])
                constant = np.max(moved / largest) / (0.01 * percent)
                if speed is not None:
                    constant = distance(ends) / speed
                duration = constant / (1.0 - 0.5 * BLEND * sum(rests[-2:]))
            durations.append(duration)
    return np.cumsum(durations), np.array(nodes), np.array(rests)


def distance(ends):
    """Distance between the tool's places in two postures, m."""
    places, _ = brachis.robots.tx90l_rail.tool_placements(np.array(ends))
    return np.linalg.norm(places[1] - places[0])


SIMULATED = ("abb_egm_4ms", "fanuc_stream_8ms", "kuka_rsi_4ms")


@pytest.mark.parametrize("tolerance, late", [(1e-3, 0.01), (1e-4, 0.05), (0.01, 0.004)])
@pytest.mark.parametrize("moves", ["joint", "linear"])
@pytest.mark.parametrize("profile", SIMULATED)
def test_the_deviation_is_that_of_a_simulation(
    profile, moves, tolerance, late, bend, tmp_path
):
    """It includes what rounding to percents or milliseconds adds, and a dwell."""
    options = {"tolerance": tolerance, "time_tolerance": late, "moves": moves}
    text, report = write(bend, profile, tmp_path, **options)
    assert report.place <= tolerance
    assert report.time <= late
    largest = [limit.velocity for limit in bend.robot.urdf_limits]
    program = read_steps(text, profile, largest)
    assert sum(program[2]) == 4
    is_linear = moves == "linear"
    place, time = deviation(bend, CENTER, program, is_linear=is_linear)
    assert report.place == pytest.approx(place, rel=0.1)
    assert report.time == pytest.approx(time, rel=0.1)


def test_a_wider_tolerance_needs_fewer_positions(seam, tmp_path):
    counts = [
        write(seam, "kuka_rsi_4ms", tmp_path, tolerance=tolerance, time_tolerance=0.02)[
            1
        ].positions
        for tolerance in (1e-4, 1e-3, 1e-2)
    ]
    assert counts[0] > counts[1] >= counts[2]


def test_lines_of_the_tool_keep_a_straight_path(seam, tmp_path):
    _, report = write(seam, "kuka_rsi_4ms", tmp_path, moves="linear")
    assert report.place < 1e-9


@pytest.mark.parametrize("moves", ["joint", "linear"])
def test_the_rail_of_a_kuka_is_as_fast_as_the_arm(moves, seam, tmp_path):
    """Its velocity has a variable of its own, which stays at that of the first move."""
    text, report = write(seam, "kuka_rsi_4ms", tmp_path, moves=moves)
    rail = re.findall(r"^ *\$VEL_EXTAX\[1\] = (\d+)$", text, re.MULTILINE)
    arm = re.findall(r"^ *\$VEL_AXIS\[I\] = (\d+)$", text, re.MULTILINE)
    assert rail == arm
    assert arm[0] == "10"
    assert len(arm) == (2 if moves == "linear" else report.positions)


@pytest.mark.parametrize("moves", ["joint", "linear"])
def test_zones_and_speeds_are_those_of_the_tool(moves, seam, tmp_path):
    text, _ = write(seam, "abb_egm_4ms", tmp_path, moves=moves)
    positions, durations = read_rapid(text)
    zones = [float(zone) for zone in re.findall(r"\\Z:=([\d.]+)", text)]
    nodes = np.column_stack([1e-3 * positions[:, 6], np.radians(positions[:, :6])])
    places, _ = seam.robot.tool_placements(nodes)
    way = np.linalg.norm(np.diff(places, axis=0), axis=1)
    shorter = np.minimum(way[:-1], way[1:])
    np.testing.assert_allclose(zones, 1e3 * BLEND * shorter, atol=1e-3)
    text, _ = write(seam, "kuka_rsi_4ms", tmp_path, moves=moves)
    speeds = [float(speed) for speed in re.findall(r"VEL.CP = ([\d.]+)", text)]
    if moves == "linear":
        middle = slice(1, -1)
        np.testing.assert_allclose(
            speeds[middle], (way / durations[1:])[middle], rtol=1e-2
        )


EVENTS = {
    "kuka_rsi_4ms": ("$OUT[1] = TRUE", "$OUT[1] = FALSE"),
    "abb_egm_4ms": ("SetDO do_process, 1;", "SetDO do_process, 0;"),
    "fanuc_stream_8ms": ("DO[1]=ON", "DO[1]=OFF"),
    "staubli_val3": ("doProcess = true", "doProcess = false"),
}


@pytest.mark.parametrize("profile", EVENTS)
def test_a_process_is_switched_where_its_speed_begins_and_ends(
    profile, six, seam, tmp_path
):
    motion = six if profile == "staubli_val3" else seam
    text, _ = write(motion, profile, tmp_path)
    on, off = EVENTS[profile]
    assert text.count(on) == text.count(off) == 1
    assert text.index(on) < text.index(off)
    process = next(phase for phase in motion.phases if phase.kind == "given speed")
    before, _, _ = text.partition(on)
    moves = {
        "kuka_rsi_4ms": r"\nPTP",
        "abb_egm_4ms": "    Move",
        "fanuc_stream_8ms": r":[JL] P",
        "staubli_val3": "movej",
    }
    count = len(re.findall(moves[profile], before))
    positions, _ = READERS[profile][1](text)
    values = axes_of(motion, profile, motion.position([process.begin]))
    np.testing.assert_allclose(positions[count - 1], values[0], atol=1e-4)


def test_speeds_are_percents_of_the_machines_and_of_the_right_external_axis(
    seam, tmp_path
):
    """Limits of a profile make the plan slower, not the machine."""
    profile = tmp_path / "cell.yaml"
    arm = "".join(f"  - {{joint: joint_{n}}}\n" for n in range(1, 7))
    rail = "  - {joint: rail, external: true, name: E2}\n"
    limits = "limits: {velocity: 100}\n"
    profile.write_text(f"extends: kuka_rsi_4ms\naxes:\n{arm}{rail}{limits}")
    path = tmp_path / "seam.src"
    brachis.export.write_for_controller(seam, path, profile)
    text = path.read_text()
    assert "$VEL_EXTAX[2] =" in text
    assert "$VEL_EXTAX[1]" not in text
    positions = read_krl(text.replace("E2 ", "E1 "))[0]
    percents = [int(row) for row in re.findall(r"VEL_AXIS\[I\] = (\d+)", text)][1:]
    largest = [limit.velocity for limit in seam.robot.urdf_limits]
    dense = np.linspace(0.0, seam.t_end, 100_001)
    values = axes_of(seam, "kuka_rsi_4ms", seam.position(dense))
    times = [dense[np.argmin(np.abs(values - row).max(axis=1))] for row in positions]
    steps = np.abs(np.diff(positions, axis=0))
    way = np.column_stack([1e-3 * steps[:, 6], np.radians(steps[:, :6])])
    slowest = 100.0 * np.max(way / np.diff(times)[:, None] / largest, axis=1)
    middle = slice(1, -1)  # lines between corners that are passed
    np.testing.assert_allclose(percents[middle], slowest[middle].clip(1.0), atol=0.6)


def test_a_plan_that_breaks_a_profiles_limits_is_said_with_its_program(seam, tmp_path):
    profile = tmp_path / "slow.yaml"
    profile.write_text("extends: kuka_rsi_4ms\nlimits: {velocity: 0.1}\n")
    with pytest.warns(brachis.export.RunWarning, match="velocity ratio"):
        report = brachis.export.write_for_controller(
            seam, tmp_path / "seam.src", profile
        )
    assert not report.passed


def test_lines_of_the_tool_that_end_in_another_posture_are_refused(tmp_path):
    """The arm passes its elbow's singular posture by the rail's help, which a line of the rail does not give."""
    motion = brachis.plan(
        "tx90l_rail",
        path=[
            {"line": {"by": [0.0, 0.4, 0.0]}, "stop": True},
            {"line": {"by": [0.0, 0.4, 0.0]}, "speed": 0.5},
        ],
        start=RAIL_START,
        task_space="pose",
    ).trajectory
    elbow = motion.position(np.linspace(0.0, motion.t_end, 500))[:, 3]
    assert elbow.min() < 0.0 < elbow.max()
    with pytest.raises(brachis.InputError, match="another posture than the plan's"):
        write(motion, "kuka_rsi_4ms", tmp_path, moves="linear")


def test_lines_of_the_tool_need_a_path_of_poses(seven, tmp_path):
    with pytest.raises(brachis.InputError, match="need a path of poses"):
        brachis.export.write_for_controller(
            seven, tmp_path / "a.script", FREE, form="program", moves="linear"
        )


FREE = brachis.load_profile("ur_servoj_500hz").model_copy(
    update={"arm": brachis.load_profile("franka_1khz").arm}
)


WAITS = {
    "kuka_rsi_4ms": "WAIT SEC 0.2",
    "abb_egm_4ms": "WaitTime 0.2",
    "fanuc_stream_8ms": "WAIT 0.20(sec)",
}


def test_the_arm_waits_where_the_motion_dwells(tmp_path):
    motion = brachis.plan(
        "tx90l_rail",
        path=[
            {"line": {"by": [0.0, 0.1, 0.0]}, "stop": True, "dwell": 0.2},
            {"line": {"by": [0.1, 0.0, 0.0]}},
        ],
        start=RAIL_START,
        task_space="pose",
        search=QUICK,
    ).trajectory
    for profile, wait in WAITS.items():
        text, _ = write(motion, profile, tmp_path)
        assert text.count(wait) == 1


def test_heads_name_the_robot_the_positions_and_the_deviation(seam, tmp_path):
    for profile in ("kuka_rsi_4ms", "abb_egm_4ms", "fanuc_stream_8ms"):
        text, report = write(seam, profile, tmp_path)
        head = text[:400]
        assert "tx90l_rail" in head
        assert f"{report.positions} positions" in head
        assert f"deviation {1e3 * report.place:.3g} mm" in head


def test_a_language_without_external_axes_refuses_a_rail(seam, tmp_path):
    with pytest.raises(
        brachis.InputError, match=r"not support external axes; found j1, .*, e1"
    ):
        write(seam, "staubli_val3", tmp_path)
