"""Make the figures of the README with ``python docs/make_figures.py``."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import brachis
from brachis.plots import plot_candidates, plot_comparison, plot_overview, plot_timeline, save_figure

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs/figures"


def main() -> None:
    """Write docs/figures/*.png."""
    FIGURES.mkdir(exist_ok=True)
    result = brachis.plan(ROOT / "examples/01_scara_line.yaml")
    save_figure(plot_overview(result.trajectory), FIGURES / "scara_line.png")
    spec = importlib.util.spec_from_file_location("table", ROOT / "examples/02_scara_table.py")
    table = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(table)
    rows = [(float(angle), joint, result.t_end) for (angle, joint), result in table.plan_all().items()]
    save_figure(plot_comparison(rows), FIGURES / "scara_table.png")
    found = brachis.plan(ROOT / "examples/07_find_the_fastest.yaml")
    save_figure(plot_candidates(found.candidates), FIGURES / "candidates.png")
    rail = brachis.plan(ROOT / "examples/03_tx90l_rail_line.yaml")
    save_figure(plot_timeline(rail.trajectory), FIGURES / "timeline.png")


if __name__ == "__main__":
    main()
