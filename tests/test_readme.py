"""The README's commands, snippets and table, the docs' snippets, and the examples, all executed."""

import functools
import importlib.util
import re
import shlex
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml

import brachis
from brachis.apps.controller import bind_axes, robot_with_profile
from brachis.task import check_robot_settings
from support.command_line import code_of, interrupts_kept
from support.scripts import load_script

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
DOCS = ROOT / "docs"
BIN = Path(sys.executable).parent


@pytest.fixture
def clone(tmp_path):
    """A folder that looks like the repository but may be written to."""
    for name in ("robots", "examples", "docs", "pyproject.toml"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def blocks(page, language):
    return re.findall(
        rf"^```{language}\n(.*?)^```", page.read_text(), flags=re.DOTALL | re.MULTILINE
    )


PAGES = [
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if blocks(page, "python")
]


def test_there_are_snippets():
    assert {page.name for page in PAGES} == {
        "README.md",
        "closed_forms.md",
        "from_toppra.md",
        "index.md",
        "python.md",
    }


@pytest.mark.usefixtures("rough_figures")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_snippets_run(page, clone, monkeypatch):
    """Those of a page in order, as one program."""
    monkeypatch.chdir(clone)
    exec(  # noqa: S102
        compile("\n".join(blocks(page, "python")), str(page), "exec"),
        {"__name__": "__main__"},
    )


@pytest.mark.usefixtures("rough_figures")
@pytest.mark.parametrize("page", ["README.md", "docs/command_line.md"])
def test_commands_run(page, clone, monkeypatch, capfd):
    """The brachis commands of the README, and the list of all commands, in order."""
    beginning = (ROOT / page).read_text().split("## A first task")[0]
    fenced = "".join(beginning.split("```")[1::2])
    lines = re.findall(r"^brachis \w[^#\n]*", fenced, re.MULTILINE)
    assert len(lines) >= 6
    (task,) = blocks(ROOT / "README.md", "yaml")
    (clone / "task.yaml").write_text(task)
    monkeypatch.chdir(clone)
    for line in lines:
        name, *words = shlex.split(line)
        assert name == "brachis"
        if "view" in line:
            look([BIN / name, *words])
            continue
        with interrupts_kept():
            code = code_of(*words)
        assert code == 0, f"{line}: {capfd.readouterr().err}"
    (motion,) = re.findall(r"out/motion\.\w+", fenced)
    assert (clone / motion).stat().st_size > 1000


def look(command):
    """Start a viewer, and stop it once it says where to look."""
    if importlib.util.find_spec("viser") is None:
        return
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as viewer:
        assert any("look at http://127.0.0.1:" in line for line in viewer.stdout)
        viewer.send_signal(signal.SIGINT)
    assert viewer.returncode == 0


def test_task_commands_exist():
    tasks = load_script("tasks.py")
    for task in re.findall(r"python3 tasks\.py (\w+)", README):
        assert task in tasks.COMMANDS


def test_example_01_python(capsys):
    result = load_script("examples/01_scara_line.py").main()
    assert result.verified
    assert "end time 2.47" in capsys.readouterr().out


def test_example_02(monkeypatch):
    module = load_script("examples/02_scara_table.py")
    monkeypatch.setattr(module, "ANGLES_DEG", (90,))  # one of the lines, for time
    results = module.plan_all()
    assert len(results) == 3
    assert all(result.verified for result in results.values())
    assert (
        max(result.verification.worst_ratio for result in results.values()) <= 1 + 1e-4
    )
    assert max(result.verification.path_error for result in results.values()) <= 1e-9
    assert results[90, "j1"].t_end <= 2.260
    assert results[90, "j2"].t_end <= 2.267
    assert results[90, "j3"].t_end <= 2.478
    check_table("examples/02_scara_table.py", module.markdown_table(results))


def check_table(name, made):
    """Compare lines of a table of the docs with those that an example makes; last digits differ between machines."""
    (page,) = [
        page for page in DOCS.glob("*.md") if f": {name} -->" in page.read_text()
    ]
    begun = page.read_text().split(f"<!-- table: {name} -->")[1]
    table = begun.split("<!-- end of table -->")[0].strip()
    asked = {line.split("|")[1] for line in made.splitlines()}
    printed = "\n".join(
        line for line in table.splitlines() if line.split("|")[1] in asked
    )
    number = re.compile(r"\d+\.\d+")
    # In whose coordinates one of several equally fast solves ended is rounding's to say.
    coordinates = re.compile(r"\((?:j\d|chart)\)")
    texts = (coordinates.sub("", number.sub("#", text)) for text in (printed, made))
    assert len(set(texts)) == 1
    ours, theirs = (
        [float(value) for value in number.findall(text)] for text in (printed, made)
    )
    assert ours == pytest.approx(theirs, abs=0.003)


def test_the_robot_part_of_a_page_is_one(clone):
    (text,) = [
        block for block in blocks(DOCS / "my_urdf.md", "yml") if "payload" in block
    ]
    robot = yaml.safe_load(text)["robot"]
    assert (clone / "robots" / robot["limits_file"]).is_file()
    settings = check_robot_settings(robot)
    assert settings.payload.mass == 0.8
    assert settings.friction.coulomb is None
    assert settings.mounting.rpy_deg == (180.0, 0.0, 0.0)


def test_example_03(monkeypatch):
    module = load_script("examples/03_tx90l_rail_line.py")
    monkeypatch.setattr(module, "JOINTS", ("rail",))  # one of the lines, for time
    results = module.plan_all()
    assert len(results) == 3
    assert all(result.verified for result in results.values())
    assert results["rail", 10].t_end <= 0.4275
    assert results["rail", 20].t_end <= 0.4027
    assert results["rail", 40].t_end <= 0.3913
    check_table("examples/03_tx90l_rail_line.py", module.markdown_table(results))


def test_example_04():
    result = brachis.plan(ROOT / "examples/04_ur10_rail_weld.yaml")
    assert result.verified
    turned = result.trajectory.robot.tool_placements(result.trajectory.q[[0, -1]])[1]
    angle = np.arccos((np.trace(turned[0].T @ turned[1]) - 1.0) / 2.0)
    assert np.rad2deg(angle) == pytest.approx(
        25.0, abs=1.0
    )  # 20 and 15 degrees about perpendicular axes


def test_example_05(monkeypatch):
    module = load_script("examples/05_panda_circle.py")
    monkeypatch.setattr(
        module, "JOINTS", module.JOINTS[:2]
    )  # of both families, for time
    try:
        module.panda()
    except SystemExit:
        pytest.skip("example-robot-data is not installed")
    results = module.main()
    assert {result.family for result in results.values()} == {"spherical_wrist", "eaik"}
    assert all(result.verified for result in results.values())


def test_example_06(monkeypatch):
    # Which of equally fast motions it is does not matter here.
    fastest = functools.partial(brachis.plan, least_motion=False)
    monkeypatch.setattr(brachis, "plan", fastest)
    results = load_script("examples/06_free_roll.py").main()
    assert all(result.verified for result in results.values())
    assert results["free roll"].t_end < results["fixed"].t_end
    assert results["free roll"].trajectory.joint_names[-1] == "tool_roll"


def test_example_07(monkeypatch):
    module = load_script("examples/07_find_the_fastest.py")
    monkeypatch.setattr(module, "ANGLES_DEG", (45, 180))  # some of the lines, for time
    results = module.plan_all()
    assert all(result.verified for result in results.values())
    for angle in module.ANGLES_DEG:
        one_guess = min(results[angle, joint].t_end for joint in module.JOINTS)
        assert results[angle, "auto"].t_end <= one_guess * (1.0 + 1e-3)
        assert results[angle, "free start"].t_end <= results[angle, "auto"].t_end * (
            1.0 + 1e-3
        )
    assert results[180, "auto"].t_end <= 2.10
    # The path begins on the x axis: a line and its mirror image only differ by the start posture.
    mirrored = brachis.plan(module.variants(315)["free start"])
    assert results[45, "free start"].t_end == pytest.approx(mirrored.t_end, rel=2e-3)
    check_table("examples/07_find_the_fastest.py", module.markdown_table(results))


def test_example_08(tmp_path):
    figure = tmp_path / "fit.png"
    result = load_script("examples/08_cam_seam.py").main(str(figure))
    (fit,) = result.fits
    assert result.verified
    assert fit.points == 20_000
    assert fit.position_error <= fit.position_tolerance == pytest.approx(0.15e-3)
    assert len(fit.corners) == 1
    assert figure.stat().st_size > 1000


def test_example_09():
    results = load_script("examples/09_payload_friction_jerk.py").main()
    assert all(result.verified for result in results.values())
    times = [result.t_end for result in results.values()]
    assert times == sorted(times)
    assert times[-1] > 1.5 * times[0]


def test_example_10():
    module = load_script("examples/10_periodic_circle.py")
    results = module.main()
    assert all(result.verified for result in results.values())
    page = (DOCS / "phases.md").read_text()
    printed = re.search(
        r"10_periodic_circle.py`: ([0-9.]+) s per turn, or ([0-9.]+) s", page
    )
    ours = [results[name].t_end for name in ("periodic", "rest to rest")]
    assert [float(each) for each in printed.groups()] == pytest.approx(ours, abs=0.006)


def test_example_11():
    pytest.importorskip("toppra")
    result, least = load_script("examples/11_from_toppra.py").main()
    assert result.verified
    assert result.verification.worst_ratio <= 1 + 1e-4
    assert result.t_end == pytest.approx(least, rel=2e-3)
    printed = re.findall(
        r"^    (?:brachis|toppra): +([0-9.]+) s",
        (ROOT / "docs/from_toppra.md").read_text(),
        re.MULTILINE,
    )
    assert [float(each) for each in printed] == pytest.approx(
        [result.t_end, least], abs=5e-4
    )


def test_example_12(tmp_path):
    found = load_script("examples/12_today.py").main(tmp_path / "today.png")
    assert found.result.verified
    page = (ROOT / "docs/today.md").read_text()
    printed = re.search(
        r"# ([0-9.]+) % faster: ([0-9.]+) s instead of ([0-9.]+) s", page
    ).groups()
    ours = [100 * found.saved, found.result.t_end, found.recorded.t_end]
    assert [float(each) for each in printed] == pytest.approx(ours, abs=0.1)
    assert (tmp_path / "today.png").stat().st_size > 1000


def test_example_13():
    result = brachis.plan(ROOT / "examples/13_weld_seams.yaml")
    assert result.verified
    phases = result.trajectory.phases
    kinds = ["move", "given speed", "move", "dwell", "move", "given speed", "move"]
    assert [phase.kind for phase in phases] == kinds
    assert [phase.speed for phase in phases if phase.speed] == [0.2, 0.1]
    assert phases[3].duration == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(
    "name, changes",
    [
        ("14_round_the_post", {}),
        ("15_tilted_torch", {"intervals": 10}),
        # One closed form instead of all postures, and few intervals, for time.
        ("16_into_the_car_body", {"intervals": 10, "redundant_joints": ["rail"]}),
    ],
)
def test_examples_of_cells(name, changes):
    """They keep their clearance and their cone, and say so."""
    task = brachis.load_task(ROOT / f"examples/{name}.yaml")
    result = brachis.plan(task, effort="single", least_motion=False, **changes)
    assert result.verified
    kinds = {check.name for check in result.verification.checks}
    assert kinds >= ({"clearance ratio"} if task.scene else {"tool tilt ratio"})


@pytest.mark.parametrize(
    "name, kinds",
    [
        (
            "17_deburring_cycle",
            ["move", "approach", "path", "retract"] * 2 + ["move"],
        ),
        (
            "18_pick_and_place",
            ["move", "path", "dwell", "path"] * 2 + ["move"],
        ),
        ("19_order_of_welds", ["move", "path"] * 5 + ["move"]),
    ],
)
def test_examples_of_programs(name, kinds):
    task = brachis.load_task(ROOT / f"examples/{name}.yaml")
    result = brachis.plan(task, effort="single", time_limit=600.0)
    assert result.verified
    assert [part.kind for part in result.trajectory.parts] == kinds


def test_published_figure_lies_between_16_and_17_intervals():
    benchmark = load_script("studies/published_figure.py")
    assert benchmark.end_time(17) < benchmark.PUBLISHED_S < benchmark.end_time(16)


def test_task_reference_is_up_to_date():
    reference = load_script("docs/make_task_reference.py")
    pages = {reference.PAGE: reference.page, reference.PROFILES: reference.profile_page}
    for path, page in pages.items():
        assert path.read_text() == page(), "run python docs/make_task_reference.py"


def test_the_profile_of_the_docs_fits_a_robot(tmp_path):
    (text,) = blocks(DOCS / "profiles.md", "yaml")
    path = tmp_path / "cell.yaml"
    path.write_text(text)
    profile = brachis.load_profile(path)
    axes = bind_axes(profile, brachis.robots.tx90l_rail)
    assert axes.names == ("J1", "J2", "J3", "J4", "J5", "J6", "E2")
    q = np.array([[0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]])
    expected = [[0.0, 0.0, -np.degrees(1.0), 0.0, 0.0, 0.0, 500.0]]
    np.testing.assert_allclose(axes.encode(q), expected, atol=1e-12)
    robot = robot_with_profile(brachis.robots.tx90l_rail, profile, axes)
    assert list(robot.limits.velocity[1:]) <= [3, 3, 3, 6, 6, 9]


def test_robots_say_where_their_figures_come_from():
    folders = [path for path in (ROOT / "robots").iterdir() if path.is_dir()]
    assert len(folders) >= 5
    for folder in folders:
        assert (folder / "robot.urdf").is_file()
        assert len((folder / "README.md").read_text()) > 200


def test_the_quick_start_plans_the_task_of_its_file():
    text = (ROOT / "docs/quick_start.md").read_text()
    cell = re.findall(r"```{code-cell}\n(.*?)```", text, flags=re.DOTALL)[0]
    assert "examples/01_scara_line.yaml" in text
    names = {}
    exec(compile(cell, "quick_start.md", "exec"), names)  # noqa: S102
    file = brachis.load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    planned = names["result"].task.to_dict()
    for task in (file, planned):
        del task["robot"]["urdf"]
    np.testing.assert_allclose(
        planned["start"].pop("joints"), file["start"].pop("joints"), rtol=1e-15
    )
    assert planned == file


def test_what_the_commands_need_is_installed_by_what_the_readme_says():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    (all_of_them,) = extras["all"]
    named = set(re.search(r"\[(.*)\]", all_of_them).group(1).split(","))
    asked = {
        extra
        for path in (ROOT / "src").rglob("*.py")
        for extra in re.findall(
            r'(?:NotInstalledError\(.*|_EXTRA = |\bextra(?:: str )?=\s?)"(\w+)"\)?(?: from .*)?$',
            path.read_text(),
            re.MULTILINE,
        )
    }
    assert asked >= {"export", "report", "sweep", "view"}
    assert asked - named <= {"cluster", "pandas"}, (
        "no command of the README needs these"
    )
    assert asked <= set(extras)
    assert load_script("tasks.py").INSTALL["demo"] == ".[all]"
    assert 'pip install ".[all]"' in README
