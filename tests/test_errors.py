"""Errors reach the caller whole, from other processes as well."""

from __future__ import annotations

import json
import pickle

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


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0 rows"), (1, "1 row"), (2, "2 rows")]
)
def test_counts_are_written_with_their_noun(count, text):
    assert errors.write_count(count, "row") == text
