"""The example of a plug-in: as an object, and named in a task file once it is installed."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import InputError, UnknownNameError
from brachis.limits import Label, Limit, Partials
from brachis.task import task_with
from brachis.verify import verify_trajectory
from support.effort import QUICK

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "examples/limit_plugin"
MODULE = PLUGIN / "src/brachis_coupled/__init__.py"
TASK = PLUGIN / "coupled.yaml"
UPPER = 0.7


@pytest.fixture(scope="module")
def plugin():
    spec = importlib.util.spec_from_file_location("brachis_coupled", MODULE)
    module = importlib.util.module_from_spec(spec)
    sys.modules["brachis_coupled"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["brachis_coupled"]


@pytest.fixture
def installed(plugin, monkeypatch):
    """The entry point as the plug-in's pyproject.toml names it."""
    import tomllib

    points = tomllib.loads((PLUGIN / "pyproject.toml").read_text())["project"][
        "entry-points"
    ]["brachis.limits"]
    found = [
        importlib.metadata.EntryPoint(name, value, "brachis.limits")
        for name, value in points.items()
    ]
    own = importlib.metadata.entry_points
    monkeypatch.setattr(
        importlib.metadata,
        "entry_points",
        lambda group: found if group == "brachis.limits" else own(group=group),
    )
    return plugin


def sums(trajectory):
    return trajectory.sample(trajectory.t_end / 2000).q[:, 1:].sum(axis=1)


def test_it_is_one_short_file():
    assert len(MODULE.read_text().splitlines()) <= 60


def test_an_object_limits_the_motion(plugin):
    task = task_with(ROOT / "examples/01_scara_line.yaml", **QUICK)
    free = brachis.plan(task)
    assert sums(free.trajectory).max() > UPPER + 0.2, "the limit should bind"
    model = plugin.CoupledRange(("j2", "j3"), -0.5, UPPER)
    result = brachis.plan(task, own_limits=[model])
    assert result.verified
    assert sums(result.trajectory).max() == pytest.approx(UPPER, abs=1e-4)
    assert result.t_end > free.t_end
    check = {each.name: each for each in result.verification.checks}[
        "coupled range ratio"
    ]
    assert check.remark == "checked by its own formula"
    assert (check.subject, check.value) == ("j2 + j3", pytest.approx(1.0, abs=1e-4))
    report = brachis.bottleneck.report(result, check=True)
    entry = report.sensitivities.of("j2 + j3", "range", "upper")
    assert entry.change(0.1) < -1e-3
    (checked,) = [each for each in report.check.entries if each.sensitivity == entry]
    assert checked.deviation < 0.05
    # A motion that was planned without it does not pass with it.
    assert not verify_trajectory(free.trajectory, own_limits=[model]).passed


@pytest.mark.usefixtures("installed")
def test_a_task_file_names_it():
    result = brachis.plan(TASK, **QUICK)
    assert result.verified
    assert sums(result.trajectory).max() <= UPPER + 1e-4
    assert "coupled range ratio" in [
        check.name for check in verify_trajectory(result.trajectory).checks
    ]
    assert (
        json.loads(json.dumps(result.task.to_dict()))["custom_limits"]["coupled_range"][
            "upper"
        ]
        == UPPER
    )


def test_a_check_of_its_own_takes_the_marks_place(plugin):
    class Checked(plugin.CoupledRange):
        def check(self, robot, q, qdot, qddot, tau):
            assert (
                q.shape == qdot.shape == qddot.shape == tau.shape == (len(q), robot.n)
            )
            return np.abs(q[:, 1:].sum(axis=1))[:, None] / UPPER

    result = brachis.plan(
        LINE, own_limits=[Checked(("j2", "j3"), -UPPER, UPPER)], **QUICK
    )
    check = {each.name: each for each in result.verification.checks}[
        "coupled range ratio"
    ]
    assert check.remark == ""
    assert check.value == pytest.approx(1.0, abs=1e-3)


def test_a_kind_that_is_not_installed():
    with pytest.raises(UnknownNameError, match="coupled_range"):
        brachis.plan(TASK)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (
            {"joints": ["j2", "j3"], "lower": 1.0, "upper": 0.0},
            "lower must be below upper",
        ),
        ({"joints": ["j2", "j3"]}, "missing"),
        ({"joints": ["j2", "elbow"], "lower": -1.0, "upper": 1.0}, "elbow"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_wrong_parameters_are_said(parameters, said):
    task = brachis.load_task(TASK).to_dict()
    with pytest.raises(InputError, match=said) as caught:
        brachis.plan({**task, "custom_limits": {"coupled_range": parameters}})
    assert "custom_limits.coupled_range" in str(caught.value)


def test_a_start_posture_beyond_it_is_refused(plugin):
    model = plugin.CoupledRange(("j2", "j3"), 0.5, 0.7)
    said = "the range limit of 'j2 + j3' is exceeded at rest; found 0 rad at rest; allowed: 0.5 to 0.7 rad"
    with pytest.raises(brachis.errors.StartError, match=re.escape(said)):
        brachis.plan(ROOT / "examples/01_scara_line.yaml", own_limits=[model])


class Rate(Limit):
    """Rate of the last joint, rad/s; its parts are spoiled one by one below."""

    kind = "last_rate"
    longer_time = "relieves"

    def __init__(self, robot):
        self.labels = (Label("j3", "rate", "rad/s"),)
        self.lower, self.upper = -np.ones(1), np.ones(1)
        self._row = np.eye(robot.n)[[-1]]

    def values(self, motion):
        return motion.qdot @ self._row.T

    def partials(self, motion):
        return Partials(
            qdot=np.broadcast_to(self._row, (len(motion.q), *self._row.shape))
        )


class Given:
    """Bind the limit with some of its parts replaced."""

    def __init__(self, **parts):
        self.parts = parts

    def bind(self, robot):
        limit = Rate(robot)
        for name, part in self.parts.items():
            setattr(limit, name, part)
        return limit


LINE = ROOT / "examples/01_scara_line.yaml"


@pytest.mark.parametrize(
    ("parts", "where", "said"),
    [
        ({"labels": ()}, "own_limits[0].lower", "found (1,); allowed: (0,)"),
        ({"lower": np.ones(2)}, "own_limits[0].lower", "(2,)"),
        (
            {"lower": np.ones(1)},
            "own_limits[0]",
            "the lower bounds are not below the upper bounds",
        ),
        (
            {"values": lambda motion: motion.qdot[:, 2]},
            "own_limits[0].values",
            "found (2,) for 2 moments",
        ),
        (
            {"values": lambda motion: np.full((len(motion.q), 1), np.nan)},
            "own_limits[0].values",
            "not finite",
        ),
        (
            {"partials": lambda motion: Partials(qdot=motion.q)},
            "own_limits[0].partials.qdot",
            "(2, 1, 3)",
        ),
        (
            {"partials": lambda _motion: Partials()},
            "own_limits[0].partials",
            "all partial derivatives are None",
        ),
        (
            {"partials": lambda _motion: None},
            "own_limits[0].partials",
            "is not a brachis.limits.Partials",
        ),
        (
            {"labels": (Label("j1", "torque", "Nm"),)},
            "own_limits[0].labels",
            "this label exists already",
        ),
        ({"labels": ("j3",)}, "own_limits[0].labels", "Label"),
        (
            {"labels": (), "lower": np.empty(0), "upper": np.empty(0)},
            "own_limits[0].labels",
            "no values",
        ),
    ],
)
def test_a_limit_whose_parts_do_not_fit_is_refused(parts, where, said):
    with pytest.raises(InputError) as caught:
        brachis.plan(LINE, own_limits=[Given(**parts)])
    assert str(caught.value).startswith(f"{where}: ")
    assert said in str(caught.value)


@pytest.mark.parametrize("wrong", [Rate, 3.0, "torque"], ids=str)
def test_what_is_no_limit_is_refused(wrong):
    with pytest.raises(InputError, match=r"limits\[0\]: this object is not a limit"):
        brachis.plan(LINE, own_limits=[wrong])


def test_limits_are_a_list():
    with pytest.raises(InputError, match="limits: this is not a list"):
        brachis.plan(LINE, own_limits=Given())


def test_two_processes_take_it_as_well():
    code = (
        "import brachis, sys; from brachis_coupled import CoupledRange;"
        "task = brachis.load_task(sys.argv[1]).to_dict();"
        "search = {'jobs': 2, 'least_motion': False};"
        "task |= {'search': search, 'redundant_joints': ['j1'], 'spline': {'intervals': 5}};"
        "result = brachis.plan(task, own_limits=[CoupledRange(('j2', 'j3'), -0.5, 0.7)]);"
        "print(result.verified, 'coupled range ratio' in [check.name for check in result.verification.checks])"
    )
    search = os.pathsep.join(
        [str(PLUGIN / "src"), *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    environment = {**os.environ, "PYTHONPATH": search}
    command = [sys.executable, "-c", code, LINE]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "True"]
