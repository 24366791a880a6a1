"""Errors reach the caller whole, from other processes as well."""

import json
import pickle
import re

import pytest

import brachis
from brachis import errors
from brachis.task import name_task_file

ERRORS = [
    errors.InputError("wrong", where="a key", found=3, allowed="2", hint="Try 2"),
    errors.UnknownNameError("joint", "j9", ["j1", "j2"], where="start"),
    errors.LimitError("is missing", joint="j1", key="robot.limits.torque.j1"),
    errors.PathError("out of reach", s_interval=(0.2, 1.0)),
    errors.DecompositionError(
        "none", redundant_joints=["j1"], reasons={"planar": "no"}, available=[("j2",)]
    ),
    errors.PlausibilityError(["one remark", "another one"]),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_survive_pickling(error):
    again = pickle.loads(pickle.dumps(error))  # noqa: S301  (our own)
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_what_is_found_after_a_task_file_was_read_names_the_file(tmp_path):
    task = brachis.load_task(brachis.examples.scara_line).to_dict()
    wrong = {**task, "redundant_joints": ["j9"]}
    file = tmp_path / "task.yaml"
    file.write_text(json.dumps(wrong))
    problem = "redundant_joints: there is no joint named 'j9'"
    with pytest.raises(errors.UnknownNameError) as raised, name_task_file(file):
        brachis.plan(file)
    assert str(raised.value).startswith(f"{file}: {problem}")
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)  # noqa: S301  (our own)
    with (
        pytest.raises(errors.UnknownNameError, match=f"^{problem}"),
        name_task_file(wrong),
    ):
        brachis.plan(wrong)


def test_keys_that_were_set_are_named_with_the_task_file(tmp_path):
    task = brachis.load_task(brachis.examples.scara_line).to_dict()
    file = tmp_path / "task.yaml"
    file.write_text(json.dumps(task))
    changes = {"redundant_joints": ["j9"]}
    changed = brachis.load_task(file, changes=changes)
    with pytest.raises(errors.UnknownNameError) as raised:  # noqa: SIM117
        with name_task_file(file, changes):
            brachis.plan(changed)
    named = f"{file} with redundant_joints set"
    assert str(raised.value).startswith(f"{named}: redundant_joints: ")
    with pytest.raises(errors.TaskError, match="^" + re.escape(f"{named}: ")):
        brachis.load_task(file, changes={"redundant_joints": 3})


@pytest.mark.parametrize(
    "error, named",
    [
        (errors.UrdfError("not well-formed XML", where="a.urdf"), False),
        (errors.NotInstalledError("a table", "pandas", "pandas"), False),
        (errors.UrdfError("the file does not exist", where="robot.urdf"), True),
        (errors.StartError("off the path", where="start"), True),
    ],
    ids=str,
)
def test_what_is_not_the_task_s_fault_is_not_said_of_its_file(error, named):
    before = str(error)
    with pytest.raises(type(error)) as raised, name_task_file("task.yaml"):
        raise error
    assert str(raised.value) == ("task.yaml: " if named else "") + before


def test_errors_show_their_message_in_notebooks_and_logs():
    error = errors.InputError("wrong", where="a key", found=3)
    assert repr(error) == "InputError('a key: wrong; found 3')"
    assert f"{[error]}" == f"[{error!r}]"
