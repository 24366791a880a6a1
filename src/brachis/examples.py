"""Included task files: ``brachis.examples.scara_line`` is the file path of ``01_scara_line.yaml``.

Examples
--------
>>> import brachis
>>> brachis.examples.scara_line.name
'01_scara_line.yaml'
>>> brachis.load_task(brachis.examples.scara_line).task_space
('x', 'y')
"""

from __future__ import annotations

from pathlib import Path

from brachis.common.files import shipped_folder
from brachis.errors import no_attribute


def _task_files() -> dict[str, Path]:
    """Return the task files by the names of the examples, the easiest first."""
    paths = sorted(shipped_folder("examples").glob("[0-9]*_*.yaml"))
    return {path.stem.split("_", 1)[1]: path for path in paths}


def names() -> tuple[str, ...]:
    """Return the names of the examples, the easiest first."""
    return tuple(_task_files())


def __getattr__(name: str) -> Path:
    """Return the path of an example's task file."""
    paths = _task_files()
    if name not in paths:
        raise no_attribute(__name__, "examples", name, names())
    return paths[name]


def __dir__() -> list[str]:
    """List the names for completion."""
    return ["names", *names()]
