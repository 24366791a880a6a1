"""What a sweep varies: grids, rows, draws."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import brachis
from brachis.apps.sweeps import SweepSettings
from brachis.apps.sweeps.plans import Plan, load_sweep
from brachis.apps.sweeps.result import COLUMNS
from brachis.errors import TaskError
from brachis.task import Task

ROOT = Path(__file__).parents[3]


def changes(**parts):
    return SweepSettings(sweep=1, task="task.yaml", **parts).changes()


def drawn(count=1000, seed=0, **keys):
    return changes(random={"count": count, "seed": seed, "keys": keys})


def test_every_combination_of_grid_rows_and_draws():
    plans = changes(
        grid={"a": [1, 2], "b": {"linear": [0.0, 1.0, 3]}},
        rows=[{"c": "x", "d": [1]}, {"c": "y"}],
        random={"count": 2, "keys": {"e": {"uniform": [0, 1]}}},
    )
    assert list(plans[0]) == ["a", "b", "c", "d", "e"]
    assert [change["b"] for change in plans[::4]] == [0.0, 0.5, 1.0] * 2
    draws = [change["e"] for change in plans]
    assert draws == draws[:2] * 12, "the same draws for all combinations"
    assert draws[0] != draws[1]


def test_values_at_equal_ratios():
    values = [
        change["a"] for change in changes(grid={"a": {"logarithmic": [0.1, 10, 3]}})
    ]
    assert values == pytest.approx([0.1, 1.0, 10.0])
    assert {type(value) for value in values} == {float}, "which YAML can write"


def test_nothing_varied_is_one_plan():
    assert changes() == [{}]


def test_draws_follow_their_distributions():
    draws = drawn(
        u={"uniform": [1, 3]},
        l={"log_uniform": [0.01, 100]},
        n={"normal": [5, 0.5]},
        c={"choice": ["x", [1]]},
    )
    u, logs, n = (np.array([draw[key] for draw in draws]) for key in "uln")
    assert u.min() >= 1.0
    assert u.max() <= 3.0
    assert u.mean() == pytest.approx(2.0, abs=0.1)
    assert np.log10(logs).min() >= -2.0
    assert np.log10(logs).mean() == pytest.approx(0.0, abs=0.2)
    assert (n.mean(), n.std()) == pytest.approx((5.0, 0.5), abs=0.1)
    assert sum(draw["c"] == "x" for draw in draws) == pytest.approx(500, abs=60)


def test_more_draws_and_further_keys_leave_the_first_ones():
    few = drawn(10, a={"normal": [0, 1]}, b={"choice": [1, 2, 3]})
    many = drawn(
        100, b={"choice": [1, 2, 3]}, a={"normal": [0, 1]}, c={"uniform": [0, 1]}
    )
    assert [{"a": draw["a"], "b": draw["b"]} for draw in many[:10]] == few
    assert drawn(10, seed=1, a={"normal": [0, 1]}) != drawn(10, a={"normal": [0, 1]})


def test_too_many_plans_are_refused_at_once():
    with pytest.raises(
        TaskError, match=r"too many plans; found 1e\+12; allowed: at most 1000000"
    ):
        changes(grid={"a": {"linear": [0, 1, 10**6]}, "b": {"linear": [0, 1, 10**6]}})


def test_the_sweep_of_the_documentation_is_one(monkeypatch):
    monkeypatch.chdir(ROOT / "docs")
    page = Path("sweeps.md").read_text()
    (text,) = re.findall(r"^```yml\n(sweep:.*?)^```", page, re.DOTALL | re.MULTILINE)
    content = yaml.safe_load(text)
    if "random" in content:
        content["random"]["count"] = 1
    found = load_sweep(content)
    assert len(found.rows) == 48
    assert all(isinstance(plan, Plan) for _, plan in found.rows)


def test_a_key_is_refused_only_where_every_plan_that_sets_it_is(tmp_path):
    path = tmp_path / "sweep.yaml"
    grid = {"spline.intervals": [6, 7, 8]}
    content = {"sweep": 1, "task": str(brachis.examples.scara_line), "grid": grid}

    def load_with(**keys):
        grid.update(keys)
        path.write_text(yaml.safe_dump(content))
        return load_sweep(path)

    assert len(load_with(**{"robot.tool_frame": ["nope", "tool"]}).rows) == 6
    with pytest.raises(TaskError, match="an error in every plan"):
        load_with(**{"robot.tool_frame": ["nope"]})
    with pytest.raises(
        TaskError, match=r"sweep\.yaml: robot\.limits\.scale\.torqe: an error"
    ):
        load_with(**{"robot.tool_frame": ["tool"], "robot.limits.scale.torqe": [1, 2]})


def test_no_column_has_the_name_of_a_key():
    assert not set(COLUMNS) & set(Task.model_fields)
