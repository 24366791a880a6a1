"""A recorded motion from a CSV file, compared with the plan along the same path.

Usage: python examples/12_today.py [FIGURE]

The file has times and joint positions of the planar arm: a pseudo-inverse joint path, timed by toppra.
"""

from __future__ import annotations

import sys
from pathlib import Path

import brachis
from brachis.apps.comparison import plot_both_motions
from brachis.apps.plots import save_figure

ROOT = Path(__file__).parents[1]


def main(figure: str | None = None) -> brachis.Comparison:
    """Compare the motions, print the result, and draw it if a figure is named."""
    found = brachis.compare(
        Path(__file__).with_suffix(".csv"), ROOT / "robots/scara3/robot.urdf"
    )
    print(found)
    if figure:
        save_figure(plot_both_motions(found), figure)
    return found


if __name__ == "__main__":
    main(*sys.argv[1:2])
