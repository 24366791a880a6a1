"""Other ways to the fastest motion along two lines, in one run: ``python benchmarks/peers/run.py [--save]``.

Each has its extra: ``pip install -e ".[peers]"`` brings all. One that is not installed is left out. All start from the
joint path of the pseudo-inverse, or search for a better one; one checker looks at every answer at 5,001 times. Limits
hold everywhere in the answers of brachis, which are verified, at 61 places in those of CasADi and Drake, and at 401 in
those of toppra. Drake's SNOPT ends without an answer on the second line, after 20,000 iterations of this formulation.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from threadpoolctl import threadpool_limits

from committed import write
from peers import by_brachis, by_casadi, by_drake, by_toppra
from peers.lines import LINES, Answer, Line, check

SOLVERS = {
    "brachis": by_brachis.solve,
    "brachis, search over all joints": by_brachis.search,
    "CasADi and IPOPT": by_casadi.solve,
    "Drake": by_drake.solve,
    "toppra after pseudo-inverse": by_toppra.solve,
}
NEEDS = {
    "CasADi and IPOPT": "casadi",
    "Drake": "pydrake",
    "toppra after pseudo-inverse": "toppra",
}
"""Modules that have to be installed."""
REPETITIONS = 3
COLUMNS = (
    "line",
    "solver",
    "set-up",
    "solve",
    "end time",
    "limits used",
    "distance from the line",
)


def measure(line: Line, name: str) -> list[str]:
    """Solve a line several times; the times are medians."""
    module = NEEDS.get(name)
    if module and importlib.util.find_spec(module) is None:
        return [line.name, name, f"{module} is not installed", "", "", "", ""]
    answers = [SOLVERS[name](line) for _ in range(REPETITIONS)]
    return [line.name, name, *format_cells(line, answers)]


def format_cells(line: Line, answers: list[Answer]) -> list[str]:
    """Say how long it took, and what the checker finds."""
    first = answers[0]
    times = [
        float(np.median([getattr(own, part) for own in answers]))
        for part in ("set_up", "solve")
    ]
    texts = [f"{part:.3f} s" for part in times]
    if not np.isfinite(first.t_end):
        return [*texts, "none", "", ""]
    found = check(line, first)
    return [
        *texts,
        f"{first.t_end:.4f} s",
        f"{100 * found.worst:.1f} %",
        f"{found.off_path:.3f} mm",
    ]


def main() -> None:
    """Print the table; with ``--save`` also keep it."""
    rows = []
    with threadpool_limits(1):
        for name in LINES:
            line = Line.of(name)
            by_brachis.solve(line)  # imports
            for solver in SOLVERS:
                rows.append(measure(line, solver))
                print(" | ".join(rows[-1]), flush=True)
    if "--save" in sys.argv:
        about = __doc__.split("\n\n", 1)[1].replace("\n", " ").strip()
        command = "python benchmarks/peers/run.py --save"
        write("peers", command, "Beside other solvers", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
