"""G-code becomes the points of its lines and arcs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.errors import TaskError
from brachis.task.point_data import FitTolerance
from brachis.task.points.curves import fit_curves
from brachis.task.points.gcode import read_gcode


def points_of(text, rows="position"):
    points = read_gcode(text, rows if rows != "position" else ("x", "y", "z"), "a.nc")
    return points, points.notes


PROGRAM = """%
(a slot)
G21 G17 G90 G54
N10 G0 X100 Y0 Z50
N20 G1 Z10 F600
N30 X200. ; along
N40 G3 X250 Y50 I0 J50 F1200
N50 G2 X300 Y100 R50
M30
%
"""


def test_lines_and_arcs():
    points, told = points_of(PROGRAM)
    assert told == ("G-code", "skipped G54, M30")
    assert_allclose(points.position[0], [0.1, 0.0, 0.05])
    for line, end in (
        (5, [0.1, 0.0, 0.01]),
        (6, [0.2, 0.0, 0.01]),
        (7, [0.25, 0.05, 0.01]),
        (8, [0.3, 0.1, 0.01]),
    ):
        assert_allclose(points.position[points.rows == line][-1], end, atol=1e-12)
    for line, centre in ((7, [0.2, 0.05]), (8, [0.3, 0.05])):
        on_arc = points.position[points.rows == line]
        assert_allclose(
            np.linalg.norm(on_arc[:, :2] - centre, axis=1), 0.05, atol=1e-12
        )
        chord = np.linalg.norm(np.diff(on_arc, axis=0), axis=1).max()
        assert chord**2 / (8.0 * 0.05) < 1.1e-6
    assert np.isnan(points.speed[0])
    assert_allclose(np.unique(points.speed[1:]), [0.01, 0.02])


def test_units_planes_and_increments():
    points, _ = points_of("G20 G0 X1 Y0 Z0\nG91 G18\nG1 X1 F60\nG2 X0 Z2 K1\n")
    assert_allclose(points.position[-1], [0.0508, 0.0, 0.0508], atol=1e-12)
    assert_allclose(points.speed[-1], 0.0254)
    half = points.position[points.rows == 4]
    assert_allclose(
        np.hypot(half[:, 0] - 0.0508, half[:, 2] - 0.0254), 0.0254, atol=1e-12
    )


@pytest.mark.parametrize("motion, side", [("G2", 1.0), ("G3", -1.0)])
def test_whole_circles_and_long_arcs(motion, side):
    """In the plane G17, clockwise as seen from above: G2 goes from the left over the top."""
    circle, _ = points_of(f"G0 X0 Y0 Z0\n{motion} X0 Y0 I10 J0 F100\n")
    assert np.ptp(circle.position[:, 0]) == pytest.approx(0.02, rel=1e-3)
    assert side * circle.position[len(circle) // 4, 1] == pytest.approx(0.01, rel=1e-3)
    short, _ = points_of(f"G0 X0 Y0 Z0\n{motion} X10 Y0 R10 F100\n")
    long, _ = points_of(f"G0 X0 Y0 Z0\n{motion} X10 Y0 R-10 F100\n")
    heights = [np.abs(points.position[:, 1]).max() for points in (short, long)]
    assert_allclose(
        heights, [0.01 - np.sqrt(75.0) / 1e3, 0.01 + np.sqrt(75.0) / 1e3], rtol=1e-3
    )
    assert side * short.position[len(short) // 2, 1] > 0.0
    assert side * long.position[len(long) // 2, 1] > 0.0


MISTAKES = [
    ("G0 X1 Y1 Z1\nG81 X2", r"line 2: canned cycles cannot be read; found G81"),
    (
        "G0 X1 Y1 Z1\nG1 X2 A5 F10",
        r"line 2: axes other than X, Y, Z cannot be read; found A5",
    ),
    ("X1 Y1 Z1", r"line 1: coordinates before G0"),
    (
        "G0 X1 Y1 Z1\nG2 X5 Y1 I1 J1 F10",
        r"line 2: invalid arc: its start and end are at different radii; found radius 1.41421 mm at its start",
    ),
    (
        "G0 X1 Y1 Z1\nG2 X5 Y1 R1 F10",
        r"line 2: invalid arc: no circle of this radius passes through both ends; found R 1 mm for ends 4 mm apart",
    ),
    ("G0 X1 Y1 Z1\nG1 X#1 F10", r"line 2: this is not understood; found 'X#1'"),
    ("G0 X1 Y1 Z1\nG1 X2 F0", r"line 2: a feed rate must be positive; found F0"),
    (
        "G0 X1 Y1",
        r"a.nc: the program contains no motion; found 0 points.*the program never states Z",
    ),
    ("G0 X1 Y1 Z1\nM98 P1000", r"line 2: subprograms cannot be read; found M98"),
    (
        "G0 X1 Y1 Z1\nG91 G28 Z0",
        r"line 2: the reference position of the machine .*; found G28",
    ),
    ("G0 X1 Y1 Z1\nG4 P2", r"line 2: a dwell cannot be read: .*; found G4"),
    ("G7 G18\nG0 X1 Y1 Z1", r"line 1: X would be a diameter; .*; found G7"),
    (
        "G0 X1 Y1 Z1\nG1 X2e1 F10",
        r"line 2: .* not understood; found 'X2E1'; .*without exponents",
    ),
    (
        "G0 X1 Y1 Z1\nG1 X2. Y1.25E-05",
        r"line 2: this is not understood; found 'Y1.25E-05'",
    ),
    ("G0 X1 Y1 Z1\nG1 X.5E+1", r"line 2: this is not understood; found 'X.5E\+1'"),
    ("G0 X1 Y1 Z1\nG1 X 12 E3 Y5E.2", r"line 2: this is not understood; found 'Y5E.2'"),
    ("G0 X1 Y1 Z1\n/G1 X2 F10", r"line 2: this is not understood; .*no / at the start"),
    ("G0 X1 Y1 Z1\nG1 X2 X3 F10", r"line 2: a letter occurs twice .*; found X3"),
    ("G0 X1 Y1 Z1\nG1 X2 P2 F10", r"line 2: the letter P of this G1 .*; found P2"),
    ("G0 X1 Y1 Z1\nG1 X2 L2 F10", r"line 2: the letter L of this G1 .*; found L2"),
    ("G0 X1 Y1 Z1\nG1 X2 I5 F10", r"line 2: the letter I of this G1 .*; found I5"),
    (
        "G0 X1 Y1 Z1\nG2 X1 Y1 Z3 I5 K1 F10",
        r"line 2: the letter K of this G2 .*; found K1; allowed: I, J, P, R, X, Y, Z",
    ),
    (
        "G0 X1 Y1 Z1\nG2 X1 Y1 I5 P2.5 F10",
        r"line 2: invalid number of turns of an arc; found P2.5; allowed: a whole number from 1 to 1000",
    ),
    ("G0 X1 Y1 Z1\nG2 X1 Y1 I5 P1000000", r"line 2: invalid number of turns"),
    (
        "G91\nG1 X20 F300",
        r"line 2: X is incremental \(G91\), but the position before .*Begin with G90 G0",
    ),
    (
        "G90 G0 X1 Y1\nG91 Z-1",
        r"line 2: Z is incremental",
    ),
    ("G0 X1 Y1 Z1\nG92 X0", r"line 2: the work offset changes within the program"),
    (
        "G54 G0 X1 Y1 Z1\nG1 X2 F10\nG55\nG1 X3",
        r"line 3: the work offset changes within the program",
    ),
]


@pytest.mark.parametrize("text, message", MISTAKES)
def test_the_error_names_the_mistake(text, message):
    with pytest.raises(TaskError, match=message):
        points_of(text)


def test_gcode_has_positions_alone():
    with pytest.raises(
        TaskError, match=r"G-code contains only positions; found x, y, yaw"
    ):
        points_of(PROGRAM, ("x", "y", "yaw"))


def test_nothing_after_the_end_is_a_move():
    points, _ = points_of("G0 X1 Y1 Z1\nG1 X10 F600\nM30\nG1 X900 Y900\n")
    assert_allclose(points.position[-1], [0.01, 0.001, 0.001])


def test_a_plane_needs_no_third_axis():
    points, _ = points_of("G0 X0 Y0\nG1 X10 F600\nG1 Y10\n", ("x", "y"))
    assert_allclose(points.position[-1], [0.01, 0.01])


@pytest.mark.parametrize("end", ["X1550 Y50", "X1650 Y50"])
def test_an_arc_that_begins_backwards_is_told_with_its_line(end):
    """Three quarters of a turn, or one, on from a line that comes the other way."""
    program = f"G21 G90 G17\nG0 X1700 Y0\nG1 X1600 Y0\nG3 {end} I0 J50\n"
    points, *_ = points_of(program, rows=("x", "y"))
    with pytest.raises(TaskError, match=r"line 3: the path turns back by 17.* degrees"):
        fit_curves(points, FitTolerance(position=5e-5, orientation=0.5, corner=5e-3))


@pytest.mark.parametrize("turns", [1, 2, 7])
def test_arcs_of_several_turns(turns):
    """A helix of 12 mm that descends by 8 mm in all: each turn is sqrt((2 pi 12)^2 + (8 / turns)^2) mm long."""
    points, told = points_of(f"G0 X0 Y12 Z0\nG2 X0 Y12 Z-8 I0 J-12 P{turns} F600\n")
    length = np.linalg.norm(np.diff(points.position, axis=0), axis=1).sum()
    exact = turns * np.hypot(2.0 * np.pi * 0.012, 0.008 / turns)
    assert length == pytest.approx(exact, rel=1e-4)
    assert points.position[1, 0] > 0.0  # clockwise
    assert not any("skipped" in one for one in told)


def test_a_turn_is_added_to_part_of_a_turn():
    points, _ = points_of("G0 X0 Y0 Z0\nG3 X10 Y10 I0 J10 P2 F600\n")
    steps = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    assert steps.sum() == pytest.approx(2.5 * np.pi * 0.01, rel=1e-4)


def test_centres_may_be_absolute():
    arcs = (
        "G3 X20 Y20 I0 J10",
        "G90.1 G3 X20 Y20 I20 J10",
        "G18 G90.1 G17 G91.1 G3 X20 Y20 J10",
    )
    one, *others = (points_of(f"G0 X20 Y0 Z0\n{arc} F60\n")[0] for arc in arcs)
    for other in others:
        assert_allclose(other.position, one.position, atol=1e-15)


def test_a_place_that_is_set_is_where_the_path_begins():
    points, _ = points_of("G92 X5 Y0 Z1\nG91\nG1 X2 F60\n")
    assert_allclose(points.position[[0, -1]], [[5e-3, 0, 1e-3], [7e-3, 0, 1e-3]])


def test_words_that_do_not_move_the_tip_have_no_effect():
    points, told = points_of(
        "O1000\nT1 M6\nG64 P0.01\nG43 H1 G0 X0 Y0 Z5 S1000 M3\nG1 X10 F60 E1\n"
    )
    assert_allclose(points.position[-1], [0.01, 0.0, 0.005])
    assert "skipped E, G43, G64, H, M3, M6, O, P, S, T" in told
