"""Write gallery.md and benchmarks.md from committed results; ``python docs/make_pages.py``."""

from __future__ import annotations

import ast
import json
import re
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs/figures/gallery.json"
RESULTS = ROOT / "benchmarks/results"
PICTURES = {
    "01": ("scara_line.gif", "The paper's line"),
    "02": ("scara_table.png", "Eight lines, three redundant joints"),
    "03": ("tx90l_rail.gif", "Six joints on a rail"),
    "04": ("ur10_weld.png", "A welding seam"),
    "05": ("panda_circle.gif", "A seven-joint arm"),
    "06": ("free_roll.png", "A tool with free roll"),
    "07": ("candidates.png", "The fastest joint path"),
    "08": ("cam_seam.png", "Points from a CAM program"),
    "09": ("payload.png", "Payload, friction and jerk"),
    "10": ("periodic_circle.gif", "A periodic motion"),
    "11": ("joint_path.png", "A joint path"),
    "12": ("today.png", "A recorded motion"),
    "13": ("weld_seams.gif", "Two welding seams"),
    "14": ("round_the_post.gif", "Round a post"),
    "15": ("tilted_torch.gif", "A torch that may tilt"),
    "16": ("into_the_car_body.gif", "Into a car body"),
    "17": ("deburring_cycle.gif", "A deburring cycle"),
    "18": ("pick_and_place.gif", "Picked up and put down"),
    "19": ("order_of_welds.gif", "Welds in any order"),
    "20": ("positioner.gif", "A positioner turns the tube"),
    "ik_plugin": ("crane.png", "A closed form of your own: a crane"),
    "limit_plugin": ("coupled.png", "A limit of your own: two coupled joints"),
}
"""Picture and title of each example."""
GALLERY_HEAD = """\
<!-- Made by docs/make_pages.py from docs/figures/gallery.json. -->

# Gallery

All examples, with their files and end times. All motions are verified. Run `brachis plan examples/NAME.yaml` or
`python examples/NAME.py`.
"""
CARD = """\
:::{{grid-item-card}} {name}: {title}
:img-top: figures/{picture}

{about} {times}. {files}
:::
"""
BENCHMARKS_HEAD = """\
<!-- Made by docs/make_pages.py from benchmarks/results/. -->

# Benchmarks

Each table comes from a file in `benchmarks/results`, which the script named above the table writes with `--save`.
`pip install -e ".[benchmark]"` installs what the scripts need. Times are processor times of
{measured}.

## How long a plan takes

`python3 tasks.py bench` measures these times. Plans have 20 intervals, and are refined and verified unless the row says
otherwise. On a slow day of the virtual machine they take three times as long.

| what | planar arm (j1, j2, j3) | TX90L on its rail |
|---|---|---|
| one plan, `effort: single` | 108, 122, 130 ms | 162 ms |
| one plan, `effort: fast`, four guesses | 199, 179, 354 ms | 309 ms |
| `redundant_joints: auto`, `effort: fast` | 390 ms | 420 ms |
| closed form, all 8 branches, per pose of a batch of 2000 | | 0.8 to 1.3 us |
| the same with EAIK | | 17 us |

Times grow with the degree of redundancy r. With default settings, planning [this line](my_urdf.md#a-first-motion) took
0.9 s for a pose (r = 1), 2.9 s with a free roll (r = 2), and 5.3 s for a position (r = 4).
"""
BENCHMARKS_REST = """\
## All other results

| file in `benchmarks/results` | what it measures |
|---|---|
"""


def gallery() -> str:
    """Return the gallery: for every example a card with its picture, description, end times and files."""
    recorded = json.loads(GALLERY.read_text())
    names = [name for name in PICTURES if name in recorded]
    cards = "\n".join(_card(name, recorded[name]) for name in names)
    grid = f"::::{{grid}} 1 2 2 2\n:gutter: 2\n\n{cards}::::\n"
    return f"{GALLERY_HEAD}\n{grid}"


def _card(name: str, t_end: dict[str, float]) -> str:
    picture, title = PICTURES[name]
    files = _files(name)
    return CARD.format(
        name=name,
        title=title,
        picture=picture,
        about=_about(files),
        times=", ".join(f"{value:.3f} s ({key})" for key, value in t_end.items()),
        files=" ".join(f"[{path.name}](../{path.relative_to(ROOT)})" for path in files),
    )


def _files(name: str) -> list[Path]:
    patterns = (
        f"{name}_*.yaml",
        f"{name}_*.py",
        f"{name}/*.yaml",
        f"{name}/src/*/*.py",
    )
    return sorted(
        path for pattern in patterns for path in (ROOT / "examples").glob(pattern)
    )


def _about(files: list[Path]) -> str:
    """Return the description of an example: the docstring of its script, or the comment at the head of its task."""
    scripts = [path for path in files if path.suffix == ".py"]
    if scripts:
        return (ast.get_docstring(ast.parse(scripts[0].read_text())) or "").split(
            "\n\n"
        )[0]
    comment = [
        line.removeprefix("# ")
        for line in files[0].read_text().splitlines()
        if line.startswith("# ")
    ]
    return " ".join(comment[:2])


Table = tuple[list[str], list[list[str]]]
"""Columns and rows."""


def _all_rows(result: dict[str, Any]) -> Table:
    return result["columns"], result["rows"]


def _lines_of_work(result: dict[str, Any]) -> Table:
    """Return the lines that summarise all tasks of one kind, without the names of the longest tasks."""
    lines = [row for row in result["rows"] if ": " not in row[0]]
    lines = [[re.sub(r" \(.*\)$", "", cell) for cell in row] for row in lines]
    return _without_column(4, result["columns"], lines)  # the first verified motion


def _without_column(index: int, columns: list[str], rows: list[list[str]]) -> Table:
    """Return a table without one of its columns."""
    table = [row[:index] + row[index + 1 :] for row in (columns, *rows)]
    return table[0], table[1:]


def _number(text: str) -> float:
    return float(text.split(maxsplit=1)[0].rstrip("%"))


def _by_arm(result: dict[str, Any]) -> Table:
    """Return for each arm the number of lines, the worst gaps and the median time."""
    arms = defaultdict(list)
    for task, _, _, *gaps, _, time in result["rows"]:
        arm = task.split(": ")[1].split(",")[0]
        arms[arm].append([*map(_number, gaps), _number(time)])
    of_gaps = ["reported gap", "independent, fastest motion", "returned motion"]
    columns = ["arm", "lines", *of_gaps, "processor time, median"]
    rows = []
    for arm, values in arms.items():
        *gaps, times = zip(*values, strict=True)
        worst = [f"{max(gap):+.4f} %" for gap in gaps]
        rows.append([arm, str(len(values)), *worst, f"{median(times):.2f} s"])
    return columns, rows


def _worst_slides(result: dict[str, Any]) -> Table:
    """Return for each velocity limit the row with the largest excess over the least time."""
    worst: dict[str, list[str]] = {}
    for row in result["rows"]:
        limit, excess = row[0], _number(row[4])
        if limit not in worst or excess > _number(worst[limit][4]):
            worst[limit] = row
    return result["columns"][:5], [row[:5] for row in worst.values()]


def _by_robot(result: dict[str, Any]) -> Table:
    """Return for each robot with process speeds the largest deviations and the longest time; keep rows of squares."""
    groups: dict[str, list[list[str]]] = defaultdict(list)
    for row in result["rows"]:
        name = row[0] if "square" in row[0] else re.split("[,:] ", row[0])[0]
        groups[NAMES_OF_GROUPS.get(name, name)].append(row)
    rows = []
    for name, cases in groups.items():
        _, _, beside, off, times, verified = zip(*cases, strict=True)
        texts = [re.split(" above|, ", text)[0] for text in beside if "%" in text]
        offs = [float(text) for text in off if text]
        rows.append(
            [
                name,
                f"{verified.count('yes')} of {len(cases)}",
                max(texts, key=_number, default=""),
                f"{max(offs):.0e}" if offs else "",
                max((text.split(", ")[-1] for text in times), key=_number),
            ]
        )
    columns = [
        "robot or path",
        "verified",
        "end time compared with the least time, computed by hand",
        "largest deviation from the speed",
        "longest processor time",
    ]
    return columns, rows


NAMES_OF_GROUPS = {
    "TX90L": "TX90L, rail locked",
    "refused": "speed rejected; planned at the speed that the error suggests",
}


def _worst_laws(result: dict[str, Any]) -> Table:
    """Return the changes of a task with violations above 0.1 %."""
    rows = [row[:3] for row in result["rows"] if _number(row[2]) > 0.1]
    return ["change with a violation above 0.1 %", *result["columns"][1:3]], rows


def _without_growth(result: dict[str, Any]) -> Table:
    """Return all columns but the exponent of the growth."""
    return _without_column(4, result["columns"], result["rows"])


def _without_small_steps(result: dict[str, Any]) -> Table:
    """Return all columns but the one for limits that are 0.1 % wider, and the kinds with at least ten limits."""
    rows = [row for row in result["rows"] if _number(row[1]) >= 10]
    return _without_column(3, result["columns"], rows)


def _by_range(result: dict[str, Any]) -> Table:
    """Return for each kind of range how much time it saves."""
    kinds = defaultdict(list)
    for row in result["rows"]:
        ((rows_of, ranges),) = ast.literal_eval(row[1]).items()
        ((kind, value),) = ranges.items()
        unit = "m" if rows_of == "position" else "deg"
        kinds[f"`{kind}: {value}` {unit}"].append(_number(row[4]))
    rows = [
        [kind, str(len(gains)), f"{median(gains):.1f} %", f"{max(gains):.1f} %"]
        for kind, gains in kinds.items()
    ]
    return ["range", "tasks", "median gain", "largest gain"], rows


class Shown(NamedTuple):
    """The part of a result that the page shows."""

    title: str
    table: Callable[[dict[str, Any]], Table] = _all_rows
    about: str | None = None
    """Text that replaces the description in the result."""


SHOWN = {
    "work": Shown(
        "Kinds of tasks",
        _lines_of_work,
        "Every plan runs in its own process. Processor times are medians over the tasks of a row, and include child "
        "processes. End times are geometric means.",
    ),
    "growth_plans": Shown(
        "More intervals",
        _without_growth,
        "Plans for the TX90L on its rail with N intervals and `effort: single`, refined and verified.",
    ),
    "peers": Shown(
        "Other solvers",
        about="All solvers start from the joint path of the pseudo-inverse, or search for a better one. The same "
        "checker examines every solution at 5,001 instants. Limits are imposed everywhere in brachis, at 61 points in "
        "CasADi and Drake, and at 401 points in toppra. On the second line, SNOPT in Drake stops after 20,000 "
        "iterations without a solution.",
    ),
    "joint_paths": Shown(
        "Joint paths: toppra",
        about="15 paths of the KUKA iiwa 14 go through three to seven random waypoints. The plans of brachis are "
        "refined and verified; toppra meets limits at its grid points. Each row states its number of intervals.",
    ),
    "controllers": Shown("Motions as controllers run them"),
    "jerk_paths": Shown(
        "Joint paths with limited jerk: copp-py",
        about="Random joint paths of the KUKA iiwa 14 have limits on jerk, velocity, acceleration and torque.",
    ),
    "slides": Shown("Slides whose least time is known", _worst_slides),
    "strong_drives": Shown(
        "Strong drives and slow joints",
        _by_arm,
        "Largest timing gap for each arm: as reported, and as computed by an independent phase plane with 8,000 steps.",
    ),
    "laws": Shown(
        "An easier task is not slower",
        _worst_laws,
    ),
    "phases": Shown(
        "Stops and process speeds",
        _by_robot,
        "The tasks have process speeds of 0.02 to 1 m/s on part of the path, or stops at the corners of a square. The "
        "speed is checked by central differences of the tool's positions along the saved motion.",
    ),
    "tolerances": Shown(
        "What tolerances gain",
        _by_range,
        "The same random tasks are planned without and with a tolerance range for the tool.",
    ),
    "sensitivities": Shown(
        "What limits cost, and solving again",
        _without_small_steps,
        about="These limits change the end time by more than 0.1 ms if they are 1 % wider; kinds with fewer than ten "
        "limits are only counted in the last row. The derivative from the multipliers is compared with central "
        "differences (0.03 % either way), with solving again, and with the linearised problem.",
    ),
}
"""The results that the page shows, in its order."""


def benchmarks() -> str:
    """Return the page of committed results: some as tables, the others in a list of files."""
    results = {
        path.stem: json.loads(path.read_text())
        for path in sorted(RESULTS.glob("*.json"))
    }
    machines = {
        f"brachis {each['version']} on {each['machine']}" for each in results.values()
    }
    measured = "; ".join(sorted(machines))
    tables = [_benchmark(results[name], shown) for name, shown in SHOWN.items()]
    rest = "".join(
        _line(name, result) for name, result in results.items() if name not in SHOWN
    )
    return "\n".join(
        [BENCHMARKS_HEAD.format(measured=measured), *tables, BENCHMARKS_REST + rest]
    )


def _benchmark(result: dict[str, Any], shown: Shown) -> str:
    columns, rows = shown.table(result)
    about = shown.about or result["about"]
    lines = [f"## {shown.title}\n", f"`{result['command']}`. {about}\n"]
    lines += [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines) + "\n"


def _line(name: str, result: dict[str, Any]) -> str:
    """Return the line of a file, with those sentences of its description that count verified plans."""
    found = re.findall(r"(?:^|(?<=\. ))\d+ of \d+ .*?\.(?= |$)", result["about"])
    about = ". ".join([result["title"], *found])
    return f"| `{name}` | {about} |\n"


def write_gallery() -> None:
    """Write the gallery."""
    (ROOT / "docs/gallery.md").write_text(gallery())


if __name__ == "__main__":
    write_gallery()
    (ROOT / "docs/benchmarks.md").write_text(benchmarks())
