"""The example of a plug-in: as an object, and named in a task file once it is installed."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import InputError, UnknownNameError
from brachis.verify import verify_trajectory

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
    import tomllib  # noqa: PLC0415

    points = tomllib.loads((PLUGIN / "pyproject.toml").read_text())["project"]["entry-points"]["brachis.limits"]
    found = [importlib.metadata.EntryPoint(name, value, "brachis.limits") for name, value in points.items()]
    own = importlib.metadata.entry_points
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda group: found if group == "brachis.limits" else own(group=group)
    )
    return plugin


def sums(trajectory):
    return trajectory.sample(trajectory.t_end / 2000).q[:, 1:].sum(axis=1)


def test_it_is_one_short_file():
    assert len(MODULE.read_text().splitlines()) <= 60


def test_an_object_limits_the_motion(plugin):
    task = brachis.load_task(ROOT / "examples/01_scara_line.yaml")
    free = brachis.plan(None, task)
    assert sums(free.trajectory).max() > UPPER + 0.2, "the limit should bind"
    model = plugin.CoupledRange(("j2", "j3"), -0.5, UPPER)
    result = brachis.plan(None, task, limits=[model])
    assert result.verified
    assert sums(result.trajectory).max() == pytest.approx(UPPER, abs=1e-4)
    assert result.t_end > free.t_end
    check = {each.name: each for each in result.verification.checks}["coupled range ratio"]
    assert check.remark == "checked by its own formula"
    assert (check.subject, check.value) == ("j2 + j3", pytest.approx(1.0, abs=1e-4))
    report = brachis.bottleneck.report(result, check=True)
    entry = report.sensitivities.of("j2 + j3", "range", "upper")
    assert entry.change(0.1) < -1e-3
    (checked,) = [each for each in report.check.entries if each.sensitivity == entry]
    assert checked.deviation < 0.05
    # A motion that was planned without it does not pass with it.
    assert not verify_trajectory(free.trajectory, further=[model]).passed


@pytest.mark.usefixtures("installed")
def test_a_task_file_names_it():
    result = brachis.plan(None, TASK)
    assert result.verified
    assert sums(result.trajectory).max() <= UPPER + 1e-4
    assert "coupled range ratio" in [check.name for check in verify_trajectory(result.trajectory).checks]
    assert json.loads(json.dumps(result.task.to_dict()))["custom_limits"]["coupled_range"]["upper"] == UPPER


def test_a_check_of_its_own_takes_the_marks_place(plugin):
    class Checked(plugin.CoupledRange):
        def check(self, robot, q, qdot, qddot, tau):
            assert q.shape == qdot.shape == qddot.shape == tau.shape == (len(q), robot.n)
            return np.abs(q[:, 1:].sum(axis=1))[:, None] / UPPER

    result = brachis.plan(None, ROOT / "examples/01_scara_line.yaml", limits=[Checked(("j2", "j3"), -UPPER, UPPER)])
    check = {each.name: each for each in result.verification.checks}["coupled range ratio"]
    assert check.remark == ""
    assert check.value == pytest.approx(1.0, abs=1e-3)


def test_a_kind_that_is_not_installed():
    with pytest.raises(UnknownNameError, match="coupled_range"):
        brachis.plan(None, TASK)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"joints": ["j2", "j3"], "lower": 1.0, "upper": 0.0}, "lower must be below upper"),
        ({"joints": ["j2", "j3"]}, "missing"),
        ({"joints": ["j2", "elbow"], "lower": -1.0, "upper": 1.0}, "elbow"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_wrong_parameters_are_said(parameters, said):
    task = brachis.load_task(TASK).to_dict()
    with pytest.raises(InputError, match=said) as caught:
        brachis.plan(None, {**task, "custom_limits": {"coupled_range": parameters}})
    assert "custom_limits.coupled_range" in str(caught.value)


def test_a_start_posture_beyond_it_is_refused(plugin):
    model = plugin.CoupledRange(("j2", "j3"), 0.5, 0.7)
    with pytest.raises(brachis.errors.StartError, match=re.escape("the range limit of 'j2 + j3' is exceeded")):
        brachis.plan(None, ROOT / "examples/01_scara_line.yaml", limits=[model])
