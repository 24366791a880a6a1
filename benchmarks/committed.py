"""Results that are kept: ``--save`` of a benchmark writes them, docs/make_pages.py makes tables of them."""

from __future__ import annotations

import json
import os
import platform
import resource
import sys
from collections.abc import Sequence
from pathlib import Path

import brachis

FOLDER = Path(__file__).parent / "results"


def processor_time() -> float:
    """Return the processor time, s, of this process and of its children that have ended: large solves run in one."""
    used = (
        resource.getrusage(who)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return sum(each.ru_utime + each.ru_stime for each in used)


def peak_memory() -> float:
    """Return the largest memory, MB, that this process has had, or one of its children that have ended."""
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(who).ru_maxrss for who in both) / 1024.0


def save(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    about: str = "",
    name: str | None = None,
) -> None:
    """Write benchmarks/results/NAME.json, if the command line has ``--save``.

    Parameters
    ----------
    title : str
    columns : sequence of str
    rows : sequence of sequence of str
        Cells as they are printed, with units.
    about : str, optional
        A sentence or two above the table.
    name : str, optional
        The script's name by default.
    """
    script, *arguments = sys.argv
    if "--save" in arguments:
        arguments.remove("--save")
        told: list[str] = []
        for argument in arguments:
            if Path(argument).is_absolute():
                told.pop()  # where files go on this machine says nothing of the result
            else:
                told.append(argument)
        write(
            name or Path(script).stem,
            " ".join(
                [
                    "python",
                    f"{Path(script).resolve().parent.name}/{Path(script).name}",
                    *told,
                ]
            ),
            title,
            columns,
            rows,
            about,
        )


def write(
    name: str,
    command: str,
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    about: str,
) -> None:
    """Write one file of results."""
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    content = {
        "title": title,
        "command": command,
        "version": brachis.__version__,
        "machine": machine,
        "about": about,
        "columns": list(columns),
        "rows": [list(row) for row in rows],
    }
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.json").write_text(
        json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
