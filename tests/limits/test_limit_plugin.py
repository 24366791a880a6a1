"""The example of a plug-in: as an object, and named in a task file once it is installed."""

import importlib.metadata
import importlib.util
import json
import os
import re
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import brachis
from brachis.errors import InputError, UnknownNameError
from brachis.limits import Bound, Label, Limit, Partials
from brachis.verify import verify_trajectory
from support.checks import check_of
from support.effort import QUICK
from support.scripts import output_of

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "examples/limit_plugin"
MODULE = PLUGIN / "src/brachis_coupled/__init__.py"
TASK = PLUGIN / "coupled.yaml"
LINE = ROOT / "examples/01_scara_line.yaml"
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
def entry_point(plugin, monkeypatch):
    """The entry point as the plug-in's pyproject.toml names it."""
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text())["project"]
    kind = "brachis.limits"
    points = project["entry-points"][kind].items()
    found = [importlib.metadata.EntryPoint(*point, kind) for point in points]
    own = importlib.metadata.entry_points
    monkeypatch.setattr(
        importlib.metadata,
        "entry_points",
        lambda group: found if group == kind else own(group=group),
    )
    return plugin


def sums(trajectory):
    return trajectory.sample(trajectory.t_end / 2000).q[:, 1:].sum(axis=1)


def test_it_is_one_short_file():
    assert len(MODULE.read_text().splitlines()) <= 60


def test_an_object_limits_the_motion(plugin, tmp_path):
    free = brachis.plan(LINE, **QUICK)
    assert sums(free.trajectory).max() > UPPER + 0.2, "the limit should bind"
    model = plugin.CoupledRange(("j2", "j3"), -0.5, UPPER)
    result = brachis.plan(LINE, own_limits=[model], **QUICK)
    assert result.verified
    assert sums(result.trajectory).max() == pytest.approx(UPPER, abs=1e-4)
    assert result.t_end > free.t_end
    check = check_of(result.verification, "coupled range ratio")
    assert check.remark == "checked by its own formula"
    assert check.in_words().endswith(check.remark)
    assert (check.subject, check.value) == ("j2 + j3", pytest.approx(1.0, abs=1e-4))
    report = brachis.bottleneck.report(result, check=True)
    entry = report.sensitivities.of("j2 + j3", "range", "upper")
    assert entry.change(0.1) < -1e-3
    (checked,) = [row for row in report.check.entries if row.sensitivity == entry]
    assert checked.deviation < 0.05
    result.trajectory.save(tmp_path / "limited.npz")
    saved = brachis.Trajectory.load(tmp_path / "limited.npz")
    assert saved.own_limits == ("coupled range",)
    with pytest.warns(brachis.errors.BrachisWarning, match="coupled range"):
        verify_trajectory(saved)
    assert verify_trajectory(saved, own_limits=[model]).passed  # without a warning
    # A motion that was planned without it does not pass with it.
    assert not verify_trajectory(free.trajectory, own_limits=[model]).passed


def test_a_program_warns_once_of_a_limit_that_is_not_checked(plugin):
    model = plugin.CoupledRange(("j2", "j3"), -3.0, 3.0)
    moves = [{"move": {"joints": [0.3, 0.2, x]}} for x in (0.2, 0.3)]
    result = brachis.plan(
        "scara3", program=moves, start=[0.2, 0.2, 0.2], own_limits=[model], **QUICK
    )
    with pytest.warns(brachis.errors.BrachisWarning) as caught:
        verify_trajectory(result.trajectory)
    assert len(caught) == 1


@pytest.mark.usefixtures("entry_point")
def test_a_task_file_names_it():
    result = brachis.plan(TASK, **QUICK)
    assert result.verified
    assert sums(result.trajectory).max() <= UPPER + 1e-4
    assert check_of(verify_trajectory(result.trajectory), "coupled range ratio")
    content = json.loads(json.dumps(result.task.to_dict()))
    assert content["custom_limits"]["coupled_range"]["upper"] == UPPER


def test_a_check_of_its_own_takes_the_marks_place(plugin):
    class Checked(plugin.CoupledRange):
        def check(self, robot, q, qdot, qddot, tau):
            assert (
                q.shape == qdot.shape == qddot.shape == tau.shape == (len(q), robot.n)
            )
            return np.abs(q[:, 1:].sum(axis=1))[:, None] / UPPER

    model = Checked(("j2", "j3"), -UPPER, UPPER)
    result = brachis.plan(LINE, own_limits=[model], **QUICK)
    check = check_of(result.verification, "coupled range ratio")
    assert check.remark == ""
    assert check.value == pytest.approx(1.0, abs=1e-3)


def test_a_kind_without_its_plugin_is_unknown():
    with pytest.raises(UnknownNameError, match="coupled_range"):
        brachis.plan(TASK)


@pytest.mark.parametrize(
    "parameters, said",
    [
        ("{joints: [j2, j3], lower: 1.0, upper: 0.0}", "lower must be below upper"),
        ("joints: [j2, j3]", "missing"),
        ("{joints: [j2, elbow], lower: -1.0, upper: 1.0}", "elbow"),
    ],
)
@pytest.mark.usefixtures("entry_point")
def test_wrong_parameters_have_a_reason(parameters, said):
    task = brachis.load_task(TASK).to_dict()
    custom = {"coupled_range": yaml.safe_load(parameters)}
    with pytest.raises(InputError, match=said) as caught:
        brachis.plan({**task, "custom_limits": custom})
    assert "custom_limits.coupled_range" in str(caught.value)


def test_a_start_posture_beyond_it_is_an_error(plugin):
    model = plugin.CoupledRange(("j2", "j3"), 0.5, 0.7)
    said = "the range limit of 'j2 + j3' is exceeded at rest; found 0 rad at rest; allowed: 0.5 to 0.7 rad"
    with pytest.raises(brachis.errors.StartError, match=re.escape(said)):
        brachis.plan(LINE, own_limits=[model])


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


def refusal_at(place, **parts):
    """What is said of a limit with these parts, which is refused at a place."""
    with pytest.raises(InputError) as caught:
        brachis.plan(LINE, own_limits=[Given(**parts)])
    assert caught.value.where == place
    assert str(caught.value).startswith(f"{place}: ")
    return str(caught.value)


@pytest.mark.parametrize(
    "name, spoilt, place, said",
    [
        ("labels", (), ".lower", "found (1,); allowed: (0,)"),
        ("lower", np.ones(1), "", "the lower bounds are not below the upper bounds"),
        ("values", lambda m: m.qdot[:, 2], ".values", "found (6,) for 6 moments"),
        ("values", lambda m: np.nan * m.q[:, :1], ".values", "not finite"),
        ("values", lambda m: m.qdot[:, 2:].tolist(), ".values", "found list [["),
        ("values", lambda m: m.qdot[:, 2:] + 0j, ".values", "an array of complex128"),
        ("partials", lambda m: Partials(qdot=m.q), ".partials.qdot", "(6, 1, 3)"),
        (
            "partials",
            lambda _m: Partials(),
            ".partials",
            "all partial derivatives are None",
        ),
        ("partials", lambda _m: None, ".partials", "is not a brachis.limits.Partials"),
        (
            "labels",
            (Label("j1", "torque", "Nm"),),
            ".labels",
            "this label exists already",
        ),
        ("labels", ("j3",), ".labels", "Label"),
    ],
)
def test_a_limit_whose_parts_do_not_fit_is_an_error(name, spoilt, place, said):
    assert said in refusal_at(f"own_limits[0]{place}", **{name: spoilt})


def test_a_limit_of_no_values_is_an_error():
    none = np.empty(0)
    text = refusal_at("own_limits[0].labels", labels=(), lower=none, upper=none)
    assert "no values" in text


@pytest.mark.parametrize(
    "member, wrong, allowed",
    [
        ("kind", None, "a name"),
        ("kind", "torque", "a kind of its own"),
        ("order", 4, "2, or 3"),
        ("guarantee", "mean", "Guarantee.AS_MEAN"),
        ("role", "robot", "Role.PROCESS"),
        ("breaks", 0.5, "from 0 to 1"),
        ("breaks", (0.2, 1.5), "from 0 to 1"),
        ("longer_time", "relieve", "'neither'"),
        ("at_rest", "postures", "'posture'"),
        ("refusal", None, "a text"),
        ("bounds", (1,), "Bound"),
        ("bounds", (Bound(1, 1.0, 1.0, 1.0),), "0 to c - 1"),
        ("violation_scale", 0.0, "> 0"),
        ("inset", -1.0, ">= 0"),
        ("lower", [-1.0], "a numpy array"),
        ("labels", (Label("j3", "rate", None),), "of texts"),
    ],
)
def test_a_member_that_is_not_allowed_is_in_the_message(member, wrong, allowed):
    assert allowed in refusal_at(f"own_limits[0].{member}", **{member: wrong})


@pytest.mark.parametrize("centre", [np.zeros(3), np.array([5.0]), np.array([np.nan])])
def test_a_centre_that_is_not_between_the_bounds_is_in_the_message(centre):
    class Off(Rate):
        def bind(self, _robot):
            return self

        @property
        def centre(self):
            return centre

    with pytest.raises(InputError, match=r"own_limits\[0\]\.centre: "):
        brachis.plan(LINE, own_limits=[Off(brachis.robots.scara3)])


def test_one_class_is_enough():
    """A limit is its own model; on every robot it is another copy."""

    class Speed(Limit):
        kind = "first_speed"
        longer_time = "relieves"
        labels = (Label("first joint", "speed", "rad/s"),)
        lower, upper = -np.ones(1), np.ones(1)

        def values(self, motion):
            return motion.qdot[:, :1] / 0.1

        def partials(self, motion):
            first = np.eye(self.robot.n)[None, :1] / 0.1
            return Partials(qdot=np.repeat(first, len(motion.q), axis=0))

    speed = Speed()
    result = brachis.plan(LINE, own_limits=[speed], **QUICK)
    assert result.verified
    assert check_of(result.verification, "first speed ratio").value > 0.9
    assert not hasattr(speed, "robot")
    robot = brachis.robots.scara3
    assert speed.bind(robot).robot is robot


def test_two_limits_may_have_one_kind_and_not_one_label():
    second = Given(labels=(Label("elbow", "rate", "rad/s"),))
    assert brachis.plan(LINE, own_limits=[Given(), second], effort="single").verified
    with pytest.raises(InputError, match="this label exists already"):
        brachis.plan(LINE, own_limits=[Given(), Given()])


@pytest.mark.parametrize(
    "ratios, said",
    [
        (lambda _q: None, "found NoneType None; allowed: a numpy array"),
        (lambda q: q[:, :1] * np.nan, "not finite"),
        (lambda q: q[:, 0], "wrong shape"),
    ],
)
def test_a_check_that_gives_no_ratios_is_refused_before_the_search(ratios, said):
    class Checked(Given):
        def check(self, robot, q, qdot, qddot, tau):
            return ratios(q)

    with pytest.raises(InputError, match=said) as caught:
        brachis.plan(LINE, own_limits=[Checked()])
    assert caught.value.where == "own_limits[0].check"


class Failing(Given):
    """A plug-in of which one part fails."""

    def __init__(self, part):
        self.part = part
        self.fail_in("__init__")
        super().__init__()

    def fail_in(self, part):
        if self.part == part:
            raise RuntimeError("no licence")

    def bind(self, robot):
        self.fail_in("bind")
        fail_in = self.fail_in

        class Own(Rate):
            def values(self, motion):
                fail_in("values")
                return super().values(motion)

            def partials(self, motion):
                fail_in("partials")
                return super().partials(motion)

        return Own(robot)

    def check(self, robot, q, qdot, qddot, tau):
        self.fail_in("check")
        return np.abs(qdot[:, 2:])


def install(monkeypatch, plugin):
    """Let a class be the one plug-in, named `failing`."""
    entry = SimpleNamespace(name="failing", value="__init__", load=lambda: plugin)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])


@pytest.mark.parametrize("part", ["__init__", "bind", "values", "partials", "check"])
def test_a_failing_plugin_is_in_the_message(part, monkeypatch):
    install(monkeypatch, Failing)
    with pytest.raises(InputError, match="no licence") as caught:
        brachis.plan(LINE, custom_limits={"failing": {"part": part}})
    assert str(caught.value).startswith(
        f"custom_limits.failing: the plug-in's {part} failed: RuntimeError: no licence"
    )


def test_a_plugin_that_fails_later_is_in_the_message(monkeypatch):
    class Late(Rate):
        def values(self, motion):
            if np.isnan(motion.s).any() or len(motion.q) in {6, 24, 72}:
                return super().values(motion)
            raise ValueError("no licence")

    install(monkeypatch, lambda: SimpleNamespace(bind=Late))
    said = (
        r"custom_limits\.failing: the plug-in's values failed: ValueError: no licence"
    )
    with pytest.raises(InputError, match=said):
        brachis.plan(LINE, custom_limits={"failing": {}}, **QUICK)


def test_an_exception_in_the_users_own_program_passes():
    def fail(_motion):
        raise ValueError("my own")

    with pytest.raises(ValueError, match=r"^my own$"):
        brachis.plan(LINE, own_limits=[Given(values=fail)])


class Alike:
    """It has the methods of a limit, but no defaults of the optional members."""

    kind = "alike"

    def bind(self, _robot):
        return self

    def values(self, motion):
        return motion.q


@pytest.mark.parametrize(
    "own_limits, said",
    [
        (
            [Rate],
            r"own_limits\[0\]: this object is not a limit; found <class '.*Rate'>",
        ),
        ([3.0], r"own_limits\[0\]: .* found an object of the class float; .* inherits"),
        (["torque"], r"own_limits\[0\]: this object is not a limit"),
        (Given(), "own_limits: this is not a list"),
        ([Alike()], r"the class Alike; allowed: .* inherits brachis\.limits\.Limit"),
    ],
    ids=["a class", "a number", "a text", "no list", "no heir"],
)
def test_what_is_no_list_of_limits_is_an_error(line_result, own_limits, said):
    with pytest.raises(InputError, match=said):
        brachis.plan(LINE, own_limits=own_limits)
    with pytest.raises(InputError, match=said):
        verify_trajectory(line_result, own_limits=own_limits)


TWO_PROCESSES = """
import brachis
from brachis_coupled import CoupledRange
result = brachis.plan(
    brachis.examples.scara_line,
    own_limits=[CoupledRange(("j2", "j3"), -0.5, 0.7)],
    search={"jobs": 2, "least_motion": False},
    redundant_joints=["j1"],
    intervals=5,
)
print(result.verified, "coupled range ratio" in [check.name for check in result.verification.checks])
"""


def test_two_processes_take_it_as_well():
    folders = [str(PLUGIN / "src"), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))}
    printed = output_of("-c", TWO_PROCESSES, env=environment)
    assert printed.split() == ["True", "True"]


class Equal(Rate):
    """A limit that counts as equal to every other one of its kind, as those of a dataclass do."""

    __hash__ = Rate.__hash__

    def __init__(self, kind):
        self.kind = kind

    def bind(self, robot):
        Rate.__init__(self, robot)
        self.labels = (Label("j3", self.kind.replace("_", " "), "rad/s"),)
        return self

    def __eq__(self, other):
        return isinstance(other, Equal)


def test_limits_that_count_as_equal_have_rows_of_their_own():
    limits = [Equal("one_rate"), Equal("another_rate")]
    program, _ = brachis.transcribe(LINE, own_limits=limits, redundant_joints=["j1"])
    one, another = (program.rows_of(limit) for limit in limits)
    assert not np.intersect1d(one, another).size
