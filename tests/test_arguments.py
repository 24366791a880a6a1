"""Wrong names and types of arguments: told like all wrong input."""

import numpy as np
import pytest

import brachis
from brachis import export
from brachis.common.arguments import check_keywords, count, number, numbers
from brachis.errors import InputError, ResultFileError, UnknownNameError

SCARA = brachis.robots.path_of("scara3")


@pytest.mark.parametrize(
    "make, told",
    [
        (
            lambda: brachis.Line(bye=[0.1, 0.0]),
            "Line: there is no keyword named 'bye'; allowed: to, by, length, ",
        ),
        (lambda: brachis.Arc(centre=[0.1, 0.0]), r"'centre'.* Did you mean 'center'\?"),
        (
            lambda: brachis.Helix([0.1, 0.0, 0.0]),
            r"Helix: missing a required argument: 'pitch'.*pitch= \(needed\)",
        ),
        (
            lambda: brachis.Line([0.1, 0.0]),
            "Line: too many positional arguments; allowed: to=, by=, ",
        ),
        (
            lambda: brachis.compare("today.csv", SCARA, unit="deg"),
            "compare: there is no keyword named 'unit'.*'units'",
        ),
        (
            lambda: brachis.import_motion("a.csv", SCARA, units="deg"),
            r"units: wrong type; found 'deg'; allowed: {.angle",
        ),
        (
            lambda: brachis.import_motion("a.csv", SCARA, units={"angles": "deg"}),
            "Did you mean 'angle'",
        ),
        (
            lambda: brachis.import_motion("a.csv", SCARA, tolerance="1 mm"),
            "tolerance: wrong type; found '1 mm'",
        ),
        (
            lambda: brachis.import_motion("a.csv"),
            "robot: the robot is missing; allowed: a URDF file",
        ),
        (
            lambda: brachis.plan("scara4", path=brachis.Line(by=[0.1, 0.0])),
            "no robot named 'scara4'.* mean 'scara3'",
        ),
        (
            lambda: brachis.plan_many([], jobs="two"),
            "jobs: wrong type; found 'two'; allowed: a whole number >= 1",
        ),
        (
            lambda: brachis.plan_many([], jobs=0),
            "jobs: out of range; found 0; allowed: a whole number >= 1",
        ),
        (
            lambda: brachis.plan_many(brachis.load_task(brachis.examples.scara_line)),
            "tasks: this is one task, not a list of tasks; found Task",
        ),
        (
            lambda: brachis.verify_trajectory(5),
            "trajectory: this is not a motion; found int; allowed: a Trajectory, a Result, or",
        ),
    ],
)
def test_wrong_arguments_have_a_message_with_the_right_ones(make, told):
    with pytest.raises(InputError, match=told):
        make()


@pytest.mark.parametrize(
    "keywords, told",
    [
        (
            {"tolerance": 1e-3},
            (
                "This is a key inside another keyword: "
                "spline={'tolerance': ...} or solver={'tolerance': ...} or refine"
            ),
        ),
        (
            {"torque": 5.0},
            "This is a key inside another keyword: limits={'torque': ...}",
        ),
        (
            {"mass": 5.0},
            "This is a key inside another keyword: payload={'mass': ...}",
        ),
        (
            {"payload": 500},
            "allowed: a mapping with keys among mass, com, inertia. payload: Rigid body fixed to",
        ),
        (
            {"strict": "no"},
            "strict: wrong type; found 'no' (a string); allowed: true or false",
        ),
        (
            {"gravity": 9.81},
            "allowed: a list. gravity: Gravity [x, y, z] in the world frame, m/s^2",
        ),
        (
            {"tool_limits": 0.5},
            "allowed: a mapping with keys among speed, feed, acceleration, angular_speed, ",
        ),
    ],
)
def test_the_message_has_the_form_of_a_key(keywords, told):
    with pytest.raises(InputError) as found:
        brachis.plan(brachis.examples.scara_line, **keywords)
    assert told in str(found.value)


def test_a_key_of_a_section_is_found_in_a_file():
    with pytest.raises(
        InputError, match=r"This key belongs elsewhere: spline\.intervals"
    ):
        brachis.load_task({"brachis": 1, "intervals": 40})


@pytest.mark.parametrize(
    "use, told",
    [
        (
            lambda motion: motion.position("a"),
            "t: wrong type; found 'a'; allowed: a number, s",
        ),
        (lambda motion: motion.at([0.0, "b"]), "t: wrong type"),
        (lambda motion: motion.sample("a"), "dt: wrong type; found 'a'"),
        (lambda motion: motion.at(None), "t: wrong type; found None"),
        (lambda motion: motion.torque([True]), r"t: wrong type; found \[True\]"),
        (
            lambda motion: motion.at([[0.0, 0.1]]),
            r"the times have the wrong shape; found \(1, 2\)",
        ),
        (lambda motion: motion.sample(0.1, last=None), "no ending named None"),
        (lambda motion: motion.save(None), "path: wrong type; found NoneType"),
        (lambda motion: export.write(motion, 3), "path: wrong type; found int"),
        (lambda _: brachis.plots.save_figure(None, 3), "path: wrong type"),
        (
            lambda motion: brachis.compare(motion.position),
            "recorded: wrong type; found method",
        ),
        (lambda motion: motion.sample([0.1]), r"dt: wrong type; found \[0\.1\]"),
        (lambda motion: export.write(motion, "x.csv", dt="a"), "dt: wrong type"),
        (
            lambda motion: motion.save("x.txt"),
            r"x.txt: the suffix belongs to a different format; found .txt; allowed: .npz",
        ),
        (
            lambda _: brachis.robots.scara3.with_payload("5 kg"),
            "allowed: a number. mass: Mass, kg",
        ),
    ],
)
def test_wrong_types_on_a_motion(use, told, line_trajectory):
    with pytest.raises(InputError, match=told):
        use(line_trajectory)


def test_files_of_motions_are_taken_as_motions(line_trajectory, tmp_path):
    motion = line_trajectory
    motion.save(tmp_path / "result.npz")
    assert brachis.verify_trajectory(
        tmp_path / "result.npz"
    ) == brachis.verify_trajectory(motion)
    export.write(str(tmp_path / "result.npz"), tmp_path / "motion.csv", dt=0.1)
    assert (tmp_path / "motion.csv").read_text().startswith("t,q_j1")
    with pytest.raises(
        ResultFileError, match="the file is of a different kind; found a task file"
    ):
        brachis.verify_trajectory(brachis.examples.scara_line)


@pytest.mark.parametrize(
    "module, name, meant",
    [
        (brachis.robots, "scara4", "scara3"),
        (brachis.examples, "scara_lin", "scara_line"),
    ],
)
def test_misspelt_names_of_what_comes_along(module, name, meant):
    with pytest.raises(AttributeError, match=f"Did you mean '{meant}'"):
        getattr(module, name)


def test_numbers():
    assert number(np.int64(3), "t", "s") == 3.0
    np.testing.assert_array_equal(numbers([1, 2.5], "t", "s"), [1.0, 2.5])
    assert count(np.int64(3), "jobs") == 3
    with pytest.raises(InputError):
        count(True, "jobs")


def test_a_function_keeps_its_name_and_arguments():
    @check_keywords
    def greet(name, *, loud=False):
        return f"{name}{'!' * loud}"

    assert greet("you", loud=True) == "you!"
    assert greet.__name__ == "greet"
    with pytest.raises(UnknownNameError, match="Did you mean 'loud'"):
        greet("you", lout=True)
