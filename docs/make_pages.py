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
    "01": "scara_line.gif",
    "02": "scara_table.png",
    "03": "tx90l_rail.gif",
    "04": "ur10_weld.png",
    "05": "panda_circle.png",
    "06": "free_roll.png",
    "07": "candidates.png",
    "08": "cam_seam.png",
    "09": "payload.png",
    "10": "periodic_circle.gif",
    "11": "joint_path.png",
    "12": "today.png",
    "ik_plugin": "crane.png",
    "limit_plugin": "coupled.png",
}
GALLERY_HEAD = """\
<!-- Made by docs/make_pages.py from docs/figures/gallery.json. -->

# Gallery

Every example of the repository, with what it gives: pictures and end times are made by `python docs/make_figures.py`,
and every motion shown is verified. Run one by `brachis plan examples/NAME.yaml` or `python examples/NAME.py`.
"""
BENCHMARKS_HEAD = """\
<!-- Made by docs/make_pages.py from benchmarks/results/. -->

# Benchmarks

Each table is made from a file in `benchmarks/results`, which the script named above it writes with `--save`. Times are
processor times on the machine that the file names, unless a table says otherwise; they do not compare between machines.

## How long a plan takes

```{include} ../README.md
:start-after: <!-- timings -->
:end-before: <!-- end of timings -->
```
"""


def gallery() -> str:
    """Return the gallery: title, picture, end times and source of every example."""
    ended = json.loads(GALLERY.read_text())
    return "\n".join(
        [GALLERY_HEAD, *(_example(name, PICTURES[name], ended[name]) for name in PICTURES if name in ended)]
    )


def _example(name: str, picture: str, t_end: dict[str, float]) -> str:
    files = sorted(
        path
        for pattern in (f"{name}_*.yaml", f"{name}_*.py", f"{name}/*.yaml", f"{name}/src/*/*.py")
        for path in (ROOT / "examples").glob(pattern)
    )
    stem = files[0].stem if name[0].isdigit() else name
    times = ", ".join(f"{value:.4f} s ({key})" for key, value in t_end.items())
    parts = [f"## {stem}\n", f"{_about(files)}\n", f"![{stem}](figures/{picture})\n", f"End time: {times}.\n"]
    for path in files:
        parts.append(f":::{{dropdown}} {path.relative_to(ROOT)}")
        parts.append(f"```{{literalinclude}} ../{path.relative_to(ROOT)}\n```\n:::\n")
    return "\n".join(parts)


def _about(files: list[Path]) -> str:
    """Return what an example says of itself: the docstring of its script, or the comment at the head of its task."""
    scripts = [path for path in files if path.suffix == ".py"]
    if scripts:
        return (ast.get_docstring(ast.parse(scripts[0].read_text())) or "").split("\n\n")[0]
    comment = [line.removeprefix("# ") for line in files[0].read_text().splitlines() if line.startswith("# ")]
    return " ".join(comment[:2])


def benchmarks() -> str:
    """Return the page of all committed results."""
    return "\n".join(
        [BENCHMARKS_HEAD, *(_benchmark(json.loads(path.read_text())) for path in sorted(RESULTS.glob("*.json")))]
    )


def _benchmark(result: dict[str, Any]) -> str:
    lines = [f"## {result['title']}\n", f"`{result['command']}`, brachis {result['version']}, {result['machine']}.\n"]
    lines += [f"{result['about']}\n"] if result["about"] else []
    lines += [f"| {' | '.join(result['columns'])} |", "|---" * len(result["columns"]) + "|"]
    lines += [f"| {' | '.join(row)} |" for row in result["rows"]]
    return "\n".join(lines) + "\n"


def write_gallery() -> None:
    """Write the gallery."""
    (ROOT / "docs/gallery.md").write_text(gallery())


if __name__ == "__main__":
    write_gallery()
    (ROOT / "docs/benchmarks.md").write_text(benchmarks())
