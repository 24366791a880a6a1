"""Tables as spreadsheets and CAM write them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import TaskError
from brachis.task.point_data import FileUnits, PointFile
from brachis.task.points.tables import read_points


def read(text, rows="pose", units=None, orientation=None):
    settings = PointFile(
        file="a.csv", units=units or FileUnits(), orientation=orientation
    )
    points = read_points(text, rows, settings, "a.csv")
    return points, points.notes


@pytest.mark.parametrize(
    "text, told",
    [
        ("x,y,z\n1.5,2,3\n4,5,6\n", ()),
        (
            "x;y;z\n1,5;2;3\n4;5;6\n",
            ("columns separated by semicolons", "decimal commas"),
        ),
        (
            "\ufeffX\tY\tZ\r\n1.5\t2\t3\r\n4\t5\t6\r\n",
            ("a byte order mark", "columns separated by tabs"),
        ),
        (
            "# made by hand\n\nx y z\n 1.5   2 3 \n4 5 6",
            ("columns separated by spaces",),
        ),
        ('"z","y","x"\n"3","2","1.5"\n6,5,4\n', ()),
    ],
)
def test_forms_are_found_out(text, told):
    points, found = read(text)
    assert_array_equal(points.position, [[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert found == told


@pytest.mark.parametrize(
    "header", ["x_mm,y_mm,z_mm", "X [mm],Y [mm],Z [mm]", "x (mm),y(mm),z mm"]
)
def test_units_in_the_header(header):
    points, told = read(f"{header}\n1,2,3\n4,5,6\n")
    assert_allclose(points.position, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]) / 1e3)
    assert told == ("length in mm, as stated in the header",)


def test_units_of_the_task():
    text = "x,y,z,rx,ry,rz,f\n1,2,3,0,0,90,600\n4,5,6,0,0,45,1200\n"
    points, told = read(
        text,
        units=FileUnits(length="mm", angle="deg", speed="mm/min"),
        orientation="rotation_vector",
    )
    assert_allclose(points.position[1], [4e-3, 5e-3, 6e-3])
    assert_allclose(
        points.turning[0], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-15
    )
    assert_allclose(points.speed, [0.01, 0.02])
    assert told == ("orientations: axis times angle",)
    assert points.rows.tolist() == [2, 3]


def test_quaternions_get_like_signs():
    points, _ = read(
        "x,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1,0,0,-1,0,0,0\n2,0,0,1,0,0,0\n"
    )
    assert_allclose(points.turning, [[1.0, 0.0, 0.0, 0.0]] * 3, atol=1e-15)


MISTAKES = [
    (
        "x_mm,y_mm,z_mm\n1,2,3\n4,5,6",
        FileUnits(length="m"),
        r"line 1: the header contradicts .* found mm for x; allowed: m",
    ),
    (
        "x_ft,y,z\n1,2,3\n4,5,6",
        FileUnits(),
        r"line 1: unknown unit of length; found ft for x; allowed: m, cm, mm",
    ),
    (
        "x,y,z,feed\n1,2,3,4\n4,5,6,7",
        FileUnits(),
        r"the unit of feed is not stated; allowed: m/s, mm/s.*feed_mm/min",
    ),
    (
        "x,y,z,feed_mm/s\n1,2,3,4\n4,5,6,0",
        FileUnits(),
        r"line 3: a feed rate must be positive; found 0 m/s",
    ),
    (
        "x,y,z\n1,5,2,5,3,5\n4,5,6",
        FileUnits(),
        r"line 2: the row has the wrong number of values; found 6; .*Decimal commas need",
    ),
    (
        "x;y;z\n1.000,5;2;3\n4;5;6",
        FileUnits(),
        r"line 2: the line has both decimal points and decimal commas; found '1.000,5;2;3'",
    ),
    (
        "x;y;z\n1,5;2;3\n4;NaN;6",
        FileUnits(),
        r"line 3: the value of column y is not a finite number; found 'NaN'",
    ),
]


@pytest.mark.parametrize("text, units, message", MISTAKES)
def test_the_error_names_the_mistake(text, units, message):
    with pytest.raises(
        TaskError, match=f"a.csv: {message}" if message.startswith("line") else message
    ):
        read(text, units=units)
