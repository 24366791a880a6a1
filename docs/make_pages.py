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
    "13": "weld_seams.png",
    "14": "round_the_post.png",
    "15": "tilted_torch.png",
    "16": "into_the_car_body.png",
    "ik_plugin": "crane.png",
    "limit_plugin": "coupled.png",
}
GALLERY_HEAD = """\
<!-- Made by docs/make_pages.py from docs/figures/gallery.json. -->

# Gallery

Every example of the repository. Click a picture to see the example's source. To run one, use
`brachis plan examples/NAME.yaml` or `python examples/NAME.py`. `python docs/make_figures.py` makes the pictures and the
end times. Every motion shown is verified.
"""
CARD = """\
:::{{grid-item-card}} {stem}
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

```{include} ../README.md
:start-after: <!-- timings -->
:end-before: <!-- end of timings -->
```
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
    return CARD.format(stem=_stem(name), picture=PICTURES[name], name=name, times=times)


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


def _stem(name: str) -> str:
    return _files(name)[0].stem if name[0].isdigit() else name


def _example(name: str, t_end: dict[str, float]) -> str:
    files = _files(name)
    stem = _stem(name)
    times = ", ".join(f"{value:.4f} s ({key})" for key, value in t_end.items())
    parts = [
        f"(example-{name})=\n## {stem}\n",
        f"{_about(files)}\n",
        f"![{stem}](figures/{PICTURES[name]})\n",
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
