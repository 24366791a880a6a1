"""20,000 noisy points of a CAM seam with a corner: fitted, planned and verified.

Usage: python examples/08_cam_seam.py [FIGURE.png]

It writes the seam, 08_cam_seam.csv, next to the task, with semicolons, decimal commas and a byte order mark.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import brachis
from brachis.apps.plots import plot_fit, save_figure

TASK = Path(__file__).with_suffix(".yaml")
COLUMNS = ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg", "feed_mm/min")
POINTS, SCATTER_MM, FEED = 20_000, 0.02, 6000.0
CORNER = np.deg2rad(20.0)


def seam() -> np.ndarray:
    """Return the rows of the seam, (POINTS, 7): two waves along the rail, with a corner of 40 degrees between them."""
    rng = np.random.default_rng(8)
    along = np.linspace(-1.0, 1.0, POINTS)
    x = (
        800.0
        + 600.0 * np.tan(CORNER) * np.abs(along)
        + 15.0 * np.sin(2.0 * np.pi * along)
    )
    z = 600.0 + 40.0 * np.cos(np.pi * along)
    position = (
        np.column_stack([x, 600.0 * along, z])
        + rng.normal(size=(POINTS, 3)) * SCATTER_MM
    )
    tilt = np.column_stack([0.15 * np.sin(np.pi * along), 0.1 * along**2, 0.0 * along])
    down = Rotation.from_euler("xyz", [np.pi, 0.0, 0.0])
    turned = (Rotation.from_rotvec(tilt) * down).as_rotvec(degrees=True)
    return np.column_stack([position, turned, np.full(POINTS, FEED)])


def write(path: Path) -> None:
    """Write the seam in the format of some controllers."""
    lines = [
        ";".join(f"{value:.4f}" for value in row).replace(".", ",") for row in seam()
    ]
    path.write_text("\n".join([";".join(COLUMNS), *lines]) + "\n", encoding="utf-8-sig")


def main(figure: str | None = None) -> brachis.Result:
    """Write the seam, plan a motion along it, and print how close the path is to the points."""
    write(TASK.with_suffix(".csv"))
    result = brachis.plan(TASK)
    print(
        f"{result.t_end:.4f} s, verified: {result.verified}, planned in {result.timing['total']:.1f} s"
    )
    for fit in result.fits:
        print(fit)
    if figure is not None:
        save_figure(plot_fit(result.trajectory), figure)
    return result


if __name__ == "__main__":
    main(*sys.argv[1:2])
