"""Write the pages that are made of committed results: gallery.md and benchmarks.md; ``python docs/make_pages.py``."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs/figures/gallery.json"
RESULTS = ROOT / "benchmarks/results"
PICTURES = {
    "01": ("scara_line.gif", "The paper's line"),
    "02": ("scara_table.png", "Eight lines, three redundant joints"),
    "03": ("tx90l_rail.gif", "Six joints on a rail"),
    "04": ("ur10_weld.png", "A welding seam with a corner and an arc"),
    "05": ("panda_circle.png", "A seven-joint arm draws a circle"),
    "06": ("free_roll.png", "A tool whose roll is free"),
    "07": ("candidates.png", "The fastest of all joint paths"),
    "08": ("cam_seam.png", "Scattered points of a CAM program"),
    "09": ("payload.png", "Payload, friction and jerk"),
    "10": ("periodic_circle.gif", "A circle that is repeated without a stop"),
    "11": ("joint_path.png", "The timing of a joint path, beside toppra"),
    "12": ("today.png", "A recorded motion, and a faster one"),
    "13": ("weld_seams.png", "Two seams at given speeds, with a stop"),
    "14": ("round_the_post.png", "An elbow that goes round a post"),
    "15": ("tilted_torch.png", "A torch that may tilt"),
    "16": ("into_the_car_body.png", "Through the window of a car body"),
    "ik_plugin": ("crane.png", "A closed form of your own: a crane"),
    "limit_plugin": ("coupled.png", "A limit of your own: two coupled joints"),
}
"""Picture and title of each example."""
GALLERY_HEAD = """\
<!-- Made by docs/make_pages.py from docs/figures/gallery.json. -->

# Gallery

Every example of the repository. Click a picture to see the example's source. To run one, use
`brachis plan examples/NAME.yaml` or `python examples/NAME.py`. `python docs/make_figures.py` makes the pictures and the
end times. Every motion shown is verified.
"""
CARD = """\
:::{{grid-item-card}} {title}
:img-top: figures/{picture}
:class-img-top: thumbnail
:link: example-{name}
:link-type: ref
{times}
:::
"""
BENCHMARKS_HEAD = """\
<!-- Made by docs/make_pages.py from benchmarks/results/. -->

# Benchmarks

Each table is made from a file in `benchmarks/results`, which the script named above it writes with `--save`. `pip
install -e ".[benchmark]"` installs what the scripts need. Times are processor times on the machine that the file
names, unless a table says otherwise; they do not compare between machines.

## How long a plan takes

`python3 tasks.py bench` measures it: 20 intervals, after import, on two cores of a virtual machine in a fast hour; in a
slow hour everything takes three times as long. Plans are refined and verified unless the row says otherwise. "Goal" is
what we aim at:

| what | planar arm (j1, j2, j3) | goal | TX90L on its rail | goal |
|---|---|---|---|---|
| one plan, neither refined nor verified | 22, 23, 41 ms | 40 ms | 54 ms | |
| one plan, `effort: single` | 108, 122, 130 ms | 80 ms | 162 ms | 150 ms |
| one plan, `effort: fast`, four guesses | 199, 179, 354 ms | | 309 ms | |
| `redundant_joints: auto`, `effort: fast` | 390 ms | 3 s | 420 ms | |
| rows at 61 collocation points | 0.14 ms | | 0.21 ms | |
| their whole Jacobian | 0.15 ms | | 0.20 ms | 2.5 ms |
| closed form, all 8 branches, per pose of a batch of 2000 | | | 0.8 to 1.3 us | 5 us |
| the same by EAIK | | | 17 us | 15 us |
"""


def gallery() -> str:
    """Return the gallery: a thumbnail of every example, then title, picture, end times and source of each."""
    recorded = json.loads(GALLERY.read_text())
    names = [name for name in PICTURES if name in recorded]
    cards = "\n".join(_card(name, recorded[name]) for name in names)
    grid = f"::::{{grid}} 1 2 3 3\n:gutter: 2\n\n{cards}::::\n"
    return "\n".join(
        [GALLERY_HEAD, grid, *(_example(name, recorded[name]) for name in names)]
    )


def _card(name: str, t_end: dict[str, float]) -> str:
    values = [f"{value:.3f}" for value in t_end.values()]
    times = (
        f"{values[0]} s" if len(values) == 1 else f"{min(values)} to {max(values)} s"
    )
    picture, title = PICTURES[name]
    return CARD.format(title=title, picture=picture, name=name, times=times)


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


def _example(name: str, t_end: dict[str, float]) -> str:
    files = _files(name)
    picture, title = PICTURES[name]
    times = ", ".join(f"{value:.4f} s ({key})" for key, value in t_end.items())
    parts = [
        f"(example-{name})=\n## {title}\n",
        f"{_about(files)}\n",
        f"![{title}](figures/{picture})\n",
        f"End time: {times}.\n",
    ]
    for path in files:
        parts.append(f":::{{dropdown}} {path.relative_to(ROOT)}")
        parts.append(f"```{{literalinclude}} ../{path.relative_to(ROOT)}\n```\n:::\n")
    return "\n".join(parts)


def _about(files: list[Path]) -> str:
    """Return what an example says of itself: the docstring of its script, or the comment at the head of its task."""
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


def benchmarks() -> str:
    """Return the page of all committed results."""
    return "\n".join(
        [
            BENCHMARKS_HEAD,
            *(
                _benchmark(json.loads(path.read_text()))
                for path in sorted(RESULTS.glob("*.json"))
            ),
        ]
    )


def _benchmark(result: dict[str, Any]) -> str:
    lines = [
        f"## {result['title']}\n",
        f"`{result['command']}`, brachis {result['version']}, {result['machine']}.\n",
    ]
    lines += [f"{result['about']}\n"] if result["about"] else []
    lines += [
        f"| {' | '.join(result['columns'])} |",
        "|---" * len(result["columns"]) + "|",
    ]
    lines += [f"| {' | '.join(row)} |" for row in result["rows"]]
    return "\n".join(lines) + "\n"


def write_gallery() -> None:
    """Write the gallery."""
    (ROOT / "docs/gallery.md").write_text(gallery())


if __name__ == "__main__":
    write_gallery()
    (ROOT / "docs/benchmarks.md").write_text(benchmarks())
