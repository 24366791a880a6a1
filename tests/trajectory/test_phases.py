"""Curves of phases are joined to one spline and split again; a trajectory says what its phases are."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import ResultFileError
from brachis.trajectory import (
    PHASE_COLUMNS,
    PhaseSpline,
    Trajectory,
    join_splines,
    phase_rows,
)
from support.gantry import DWELL, SPEED, SPLINES, gantry_motion
from support.result_files import with_parts


@pytest.fixture(scope="module")
def motion():
    return gantry_motion()


def random_splines(degree):
    rng = np.random.default_rng(degree)
    splines = []
    for duration, inner in ((0.7, [0.2, 0.5]), (1e-3, []), (1 / 3, [1 / 7])):
        knots = np.repeat(
            [0.0, *inner, 1.0], [degree + 1, *[1] * len(inner), degree + 1]
        )
        points = rng.standard_normal((3, len(knots) - degree - 1))
        splines.append(PhaseSpline(duration, knots, degree, points))
    return splines


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_a_split_gives_back_the_splines_before_their_join(degree, motion):
    splines = random_splines(degree)
    knots, points = join_splines(splines)
    ends = np.cumsum([spline.t_end for spline in splines])
    parts = {"knots": knots, "control_points": points, "phase_ends": ends}
    again = replace(motion, degree=degree, **parts).phase_splines
    assert len(again) == len(splines)
    assert len(knots) == points.shape[1] + degree + 1
    for spline, other in zip(splines, again, strict=True):
        assert other.t_end == pytest.approx(spline.t_end, rel=1e-12)
        assert_allclose(other.knots, spline.knots, atol=1e-12)
        assert_array_equal(other.control_points, spline.control_points)


def test_derivatives_of_a_phase_are_per_second():
    (spline, *_) = random_splines(5)
    t = np.linspace(0.05, 0.65, 9)
    h = 1e-5
    orders = spline.at(t)
    for order in range(3):
        slope = (spline.at(t + h)[order] - spline.at(t - h)[order]) / (2.0 * h)
        assert_allclose(slope, orders[order + 1], rtol=1e-5, atol=1e-3)


def test_times_of_path_coordinates():
    times = SPLINES[3].times_of(np.array([0.55, 0.7, 0.85]))
    assert_allclose(times, [0.0, 0.5, 1.0], atol=1e-12)


def test_a_trajectory_says_what_its_phases_are(motion):
    kinds = [phase.kind for phase in motion.phases]
    assert kinds == ["move", "dwell", "move", "given speed", "move"]
    assert [phase.speed for phase in motion.phases] == [None, None, None, SPEED, None]
    assert motion.phases[1].duration == pytest.approx(DWELL)
    places = [(phase.s_begin, phase.s_end) for phase in motion.phases]
    expected = [(0.0, 0.4), (0.4, 0.4), (0.4, 0.55), (0.55, 0.85), (0.85, 1.0)]
    assert_allclose(places, expected)
    assert motion.phases[-1].end == motion.t_end


def test_a_phase_longer_than_a_part_has_no_given_speed():
    """As in recorded motions, of which only the stops are known."""
    part = {"speed": SPEED, "s": [0.1, 0.3]}
    motion = gantry_motion(SPLINES[:1], tool_limits={"process_speed": part})
    (phase,) = motion.phases
    assert phase.kind == "move"
    assert phase.speed is None


def test_splines_of_the_whole_motion_are_those_of_the_phases(motion):
    for phase, spline in zip(motion.phases, motion.phase_splines, strict=True):
        t = np.linspace(phase.begin, phase.end, 7)[:-1]
        s, redundant = spline.at(t - phase.begin)[0].T
        assert_allclose(motion.path_coordinate(t), s, atol=1e-12)
        assert_allclose(motion.redundant_spline(t)[:, 0], redundant, atol=1e-12)
        speed = spline.at(t - phase.begin)[1][:, 0]
        assert_allclose(motion.path_spline(t, nu=1), speed, atol=1e-9)
        assert motion.path_coordinate(phase.end) == phase.s_end


def test_at_the_end_of_a_phase_the_spline_is_the_next_ones(motion):
    end = motion.phases[1].end
    jerk = motion.path_spline(np.array([np.nextafter(end, 0.0), end]), nu=3)
    assert_allclose(jerk, [0.0, 60.0 * 0.15 - 24.0 * SPEED], atol=1e-9)


WRONG = {
    "an end fewer": {"phase_ends": lambda ends: ends[1:]},
    "an end moved": {"phase_ends": lambda ends: ends + 1e-6 * (ends < 1.2)},
    "ends descending": {"phase_ends": lambda ends: ends[[1, 0, 2, 3, 4]]},
    "knots once less": {
        "knots": lambda knots: np.sort(np.append(np.delete(knots, 6), 0.1))
    },
}


@pytest.mark.parametrize("case", WRONG)
def test_a_file_with_other_phases_than_knots(case, motion, tmp_path):
    motion.save(tmp_path / "result.npz")
    with_parts(tmp_path / "result.npz", **WRONG[case])
    with pytest.raises(
        ResultFileError, match=r"phase_ends: not the ends|internal knots are repeated"
    ):
        Trajectory.load(tmp_path / "result.npz")


def test_a_table_says_what_the_phases_are(motion):
    rows = phase_rows(motion.phases)
    assert rows[1] == ("2 dwell", "0.4", "0.5000 s (1.0000 to 1.5000 s)", "at rest")
    assert rows[3][1:] == ("0.55 to 0.85", "1.0000 s (2.5000 to 3.5000 s)", "0.3 m/s")
    assert {len(row) for row in rows} == {len(PHASE_COLUMNS)}
    (row,) = phase_rows([replace(motion.phases[3], leads=0.06)])
    assert row[3].startswith("0.3 m/s on 300 of 360 mm (on all with run-in")
