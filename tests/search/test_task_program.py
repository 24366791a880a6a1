"""The program that `transcribe` returns, for a solver of one's own: names of x, the guess, the trajectory."""

import numpy as np
import pytest
from scipy.optimize import Bounds, NonlinearConstraint, minimize
from scipy.sparse import coo_array

import brachis
from brachis.optimise.backends import SolverOptions, solvers_for
from support.checks import failed_checks
from support.solvers import INSTALLED


def line(**keywords):
    keywords = {"redundant_joints": ["j3"], "intervals": 16, **keywords}
    return brachis.transcribe(brachis.examples.scara_line, **keywords)[0]


def line_with_a_stop():
    path = brachis.Line(by=[0, 0.3], stop=True) + brachis.Line(by=[-0.2, 0])
    return line(path=path, intervals=5)


def without_closed_form():
    return brachis.transcribe(
        "gen3",
        path=brachis.Line(by=[0.1, 0, 0]),
        start=[0, 0.3, 0.1, 1.9, 0.1, 0.9, 0],
        task_space="pose",
        intervals=6,
    )[0]


PROGRAMS = {
    "closed form": (line, ["t_end", "s[3]", "s[4]"], "j3[16]"),
    "rest in velocity": (lambda: line(rest="velocity"), ["t_end", "s[2]"], "j3[17]"),
    "free knots": (lambda: line(intervals=4, knots="free"), ["t_end"], "h[3]"),
    "path of joints": (
        lambda: brachis.transcribe(brachis.examples.from_toppra, intervals=8)[0],
        ["t_end", "s[2]", "s[3]"],
        "s[8]",
    ),
    "chart": (without_closed_form, ["t_end", "s[3]", "s[4]", "s[5]"], "sigma_1[6]"),
    # No joint path of the first closed form is clear of the post.
    "obstacle": (
        lambda: brachis.transcribe(brachis.examples.round_the_post)[0],
        ["t_end", "s[3]"],
        "joint_3[20]",
    ),
    "stop": (
        line_with_a_stop,
        ["t_end of phase 1", "s[3] of phase 1"],
        "j3[5] of phase 2",
    ),
}


@pytest.mark.parametrize("case", PROGRAMS)
def test_a_name_says_what_its_variable_moves(case):
    make, first, last = PROGRAMS[case]
    program = make()
    names = program.names
    assert names[: len(first)] == first
    assert names[-1] == last
    assert len(set(names)) == len(names) == program.variables
    phase, x = program.split(np.linspace(0.1, 0.9, program.variables))[-1]
    curves = list(dict.fromkeys(name.partition("[")[0] for name in phase.names[1:]))
    for number, name in enumerate(phase.names[1 : phase.lengths.start], 1):
        moved = x.copy()
        moved[number] += 0.5
        change = phase.motion(moved).control_points - phase.motion(x).control_points
        curve, points = np.nonzero(change)
        assert {f"{curves[curve[0]]}[{points[0]}]"} == {name}
        assert np.ptp(curve) == 0


@pytest.mark.parametrize(
    "case",
    ["closed form", "free knots", "path of joints", "chart", "obstacle", "stop"],
)
def test_the_guess_is_a_motion_on_the_path(case):
    program = PROGRAMS[case][0]()
    trajectory = program.trajectory(program.guess)
    assert trajectory.t_end == pytest.approx(program.end_time(program.guess), rel=1e-12)
    verification = brachis.verify_trajectory(trajectory)
    assert failed_checks(verification) == []


def slsqp(program):
    """Solve by SciPy alone, from public members."""
    shape = (len(program.lower), program.variables)

    def rows(x):
        """Values that are far from their bounds where there are none, so that the step is shortened."""
        try:
            return program.rows(x)
        except brachis.errors.UnreachableError:
            return np.full(len(program.lower), -1e3)

    places = (program.jacobian_rows, program.jacobian_columns)
    return minimize(
        program.objective,
        program.guess,
        jac=program.gradient,
        method="SLSQP",
        bounds=Bounds(program.x_lower, program.x_upper),
        constraints=NonlinearConstraint(
            rows,
            program.lower,
            program.upper,
            jac=lambda x: coo_array((program.jacobian(x), places), shape).toarray(),
        ),
        options={"maxiter": 200, "ftol": 1e-9},
    )


def test_solvers_agree_on_the_line_of_the_paper_and_more_points_pass_the_checks():
    program = line()
    answer = slsqp(program)
    assert answer.success
    assert answer.fun == pytest.approx(2.5187856, abs=1e-6)
    for name in {"uno", "ipopt"}.intersection(INSTALLED):
        report = solvers_for(name)[0].solve(
            program, program.guess, SolverOptions(), None
        )
        assert report.objective == pytest.approx(answer.fun, abs=1e-6)
    rough = brachis.verify_trajectory(program.trajectory(answer.x))
    assert failed_checks(rough) == ["torque ratio"]
    dense = line(points_per_interval=32)
    assert dense.names == program.names
    report = solvers_for("uno")[0].solve(dense, answer.x, SolverOptions(), None)
    trajectory = dense.trajectory(report.x)
    assert brachis.verify_trajectory(trajectory).passed
    assert answer.fun < trajectory.t_end < 1.01 * answer.fun


def test_what_is_no_point_is_an_error():
    program = line()
    for x, words in [
        (np.ones(3), r"wrong shape.*\(3,\).*\(28,\)"),
        (np.full(28, np.nan), "not finite"),
        ([1.0] * 28, "numpy array"),
    ]:
        with pytest.raises(brachis.InputError, match=words):
            program.trajectory(x)
