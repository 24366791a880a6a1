"""Files of points with a tolerance: what a task makes of them."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.errors import TaskError
from brachis.path import build_path
from brachis.task import load_task, task_with
from brachis.task.segments import BSplineSegment, SplineSegment
from support.seams import bent, wave

MM = 1e-3


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(rows, header="x_mm,y_mm,z_mm", name="seam.csv"):
    np.savetxt(name, rows, fmt="%.9f", header=header, delimiter=",", comments="")


def task(name="seam.csv", space="position", beside=None, **keys):
    csv = {"file": name, "tolerance": {"position": "0.1 mm"}, **keys}
    segments = [{"csv": csv, **(beside or {})}]
    return task_with(start="free", task_space=space, path=segments)


def test_a_file_becomes_a_curve_that_needs_it_no_more():
    write(1e3 * wave(2_000, 0.01 * MM))
    made = task()
    (segment,), (fit,) = made.path, made.fits
    assert made.path_start == segment.bspline.control_points[0]
    assert (fit.source, fit.points, fit.corners) == ("seam.csv", 2_000, ())
    assert 0.0 < fit.position_error <= 0.1 * MM
    assert fit.told[0] == "length in mm, as stated in the header"
    assert fit.told[1].startswith("positions that scatter by 0.01")
    Path("seam.csv").unlink()
    assert_comes_back(made)
    assert str(fit).startswith("seam.csv: 2000 points along 1007.4 mm, ")
    assert "no corners; length in mm" in str(fit)


def assert_comes_back(task):
    assert load_task(json.loads(json.dumps(task.to_dict(), allow_nan=False))) == task


def test_corners_become_blends():
    write(1e3 * bent(900, 0.005 * MM)[0])
    made = task()
    (fit,) = made.fits
    blends = [corner.blend for corner in fit.corners]
    assert [segment.blend for segment in made.path] == [*blends, None]
    assert f"2 corners blended: {fit.corners[0]}, " in str(fit)
    assert " deg at row 30" in str(fit.corners[0])
    (wider,) = task(tolerance={"position": "0.1 mm", "corner": "1 mm"}).fits
    for corner, blend in zip(wider.corners, blends, strict=True):
        assert corner.blend > blend


def sharp(*, turn_back=False):
    """Points in mm along two lines with a corner at row 40, (0.2 m, 0, 0); the first one after it is 0.02 mm away."""
    first = np.linspace([0.0, 0.0, 0.0], [200.0, 0.0, 0.0], 41)
    direction = np.array([-1.0, 0.0, 0.0] if turn_back else [0.0, 1.0, 0.0])
    distances = np.concatenate([[0.02], np.linspace(5.0, 150.0, 30)])
    return np.concatenate([first, first[-1] + distances[:, None] * direction])


@pytest.mark.parametrize("turn_back", [False, True])
@pytest.mark.parametrize("tolerance", [None, {"position": "0.1 mm"}])
def test_the_tool_stops_at_corners(tolerance, turn_back):
    rows = sharp(turn_back=turn_back)
    write(rows)
    made = task(corner="stop", tolerance=tolerance)
    assert_comes_back(made)
    assert [segment.stop for segment in made.path] == [True, False]
    assert {segment.blend for segment in made.path} == {None}
    (fit,) = made.fits
    (corner,) = fit.corners
    assert (corner.blend, corner.row) == (0.0, 42)
    assert corner.distance == pytest.approx(0.2, abs=1e-6)
    angle = 180 if turn_back else 90
    assert f"1 corner at which the tool stops: {angle} deg at row 42" in str(fit)
    path = build_path(made.path, rows[0] * MM, ["x", "y", "z"])
    (place,) = path.sample(path.stops).target
    assert_allclose(place, rows[40] * MM, atol=1e-9 if tolerance else 1e-12)


def test_the_path_passes_the_first_point_after_a_corner():
    """However near it is: a first waypoint of a segment that nearly equals its start is taken for it."""
    write(sharp())
    _, after = task(corner="stop", tolerance=None).path
    assert isinstance(after, SplineSegment)
    path = build_path([after], np.array([0.2, 0.0, 0.0]), ["x", "y", "z"])
    places = path.sample(path.knots).target
    distances = np.linalg.norm(places - np.array([0.2, 2e-5, 0.0]), axis=1)
    assert distances.min() < 1e-12


def test_a_turn_back_without_a_stop_is_an_error():
    write(sharp(turn_back=True))
    with pytest.raises(TaskError, match=r"the path turns back.*Set corner: stop"):
        task()


def test_the_end_of_a_file_may_be_a_stop():
    write(sharp())
    seam = {"csv": {"file": "seam.csv", "corner": "stop"}, "dwell": 0.5}
    up = {"line": {"by": [0.0, 0.0, 0.1]}}
    path = task_with(start="free", task_space="position", path=[seam, up]).path
    assert [segment.stop for segment in path] == [True, True, False]
    assert [segment.dwell for segment in path] == [0.0, 0.5, 0.0]


def test_a_curve_keeps_feed_rates():
    rows = np.column_stack([1e3 * wave(500), np.full(500, 600.0)])
    write(rows, "x_mm,y_mm,z_mm,feed_mm/min")
    (segment,) = task().path
    assert isinstance(segment, BSplineSegment)
    ((first, last),) = segment.bspline.speeds
    assert first == (0.0, pytest.approx(0.01))
    assert last == (pytest.approx(segment.bspline.knots[-1]), pytest.approx(0.01))


def test_gcode_is_known_by_its_suffix():
    Path("part.nc").write_text(
        "G21 G0 X800 Y0 Z600\nG1 Y300 F3000\nG3 X750 Y350 I-50 J0\n", encoding="utf-8"
    )
    (fit,) = task("part.nc").fits
    assert fit.told[0] == "G-code"
    assert fit.length == pytest.approx(0.3 + 0.05 * np.pi / 2.0, abs=1e-4)


def test_rough_files_are_named_as_such():
    np.savetxt("rough.csv", wave(2_000), "%.6f", ",", header="x,y,z", comments="")
    with pytest.raises(
        TaskError,
        match=r"rough.csv: the points are too rough .*rounded to 1e-06 m at 0.\d+ mm spacing",
    ):
        task("rough.csv", tolerance=None)
    (fit,) = task("rough.csv", tolerance={"position": "0.01 mm"}).fits
    assert fit.position_error <= 0.01 * MM


WRONG = [
    (
        {"corner": "refuse"},
        r"path\[0\].corner: the points have 2 corners; found .* deg at row 30\d, .*corner: blend",
    ),
    (
        {"units": {"length": "m"}},
        r"seam.csv: line 1: the header contradicts the units in the task",
    ),
    ({"units": {"length": "feet"}}, r"path\[0\].csv.units.length.*found 'feet'"),
    (
        {"tolerance": {"position": "0.1"}},
        r"path\[0\].csv.tolerance.position: this is not a number with a unit; found '0.1'.*0.05 mm",
    ),
    ({"tolerance": {"position": 0}}, r"path\[0\].csv.tolerance.position"),
    ({"tolerance": {}}, r"path\[0\].csv.tolerance.position"),
]


@pytest.mark.parametrize("keys, message", WRONG)
def test_the_error_names_the_mistake(keys, message):
    write(1e3 * bent(900, 0.005 * MM)[0])
    with pytest.raises(TaskError, match=message):
        task(**keys)


def test_a_turn_cannot_go_on_over_corners():
    write(1e3 * bent(900, 0.005 * MM)[0])
    turn = {"orientation": {"rotate": {"axis": [0, 0, 1], "angle_deg": 30}}}
    with pytest.raises(
        TaskError,
        match=r"path\[0\].orientation: the tool cannot turn at a constant rate over corners",
    ):
        task(space="pose", beside=turn, relative=False)


@pytest.mark.parametrize(
    "change, message",
    [
        (
            np.nan,
            r"seam.csv: line 323: the value of column y_mm is not a finite number; found 'nan'",
        ),
        (40.0, r"seam.csv: line 323: the point is an outlier"),
    ],
    ids=str,
)
def test_the_error_names_a_bad_row(change, message):
    rows = 1e3 * wave(500)
    rows[321, 1] += change
    write(rows)
    with pytest.raises(TaskError, match=message):
        task()
