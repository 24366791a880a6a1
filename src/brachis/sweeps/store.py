"""A sweep's folder: every finished plan in files of its own, and the table of all of them.

``plans/3f/3f0a....parquet`` is one row, ``plans/3f/3f0a....npz`` its motion. Both are whole or not there: they are
written under temporary names, the motion first, so that a row is a plan that is finished.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from brachis.errors import InputError, NotInstalledError
from brachis.files import atomic_write, is_file, read_file, writing_errors
from brachis.sweeps.worker import Outcome

if TYPE_CHECKING:
    import pyarrow as pa

COLUMNS = {
    "status": "string",
    "t_end_s": "double",
    "worst_ratio": "double",
    "path_error": "double",
    "chosen_joints": "string",
    "chosen_branch": "string",
    "chosen_solver": "string",
    "iterations": "int64",
    "wall_time_s": "double",
    "error": "string",
    "message": "string",
    "remarks": "string",
    "motion": "string",
}
"""Of what came of a plan: names and Arrow types. Times in s; the path error in m, or rad, whichever is larger."""
TABLES = ("table.parquet", "table.csv")
_ABOUT = "sweep.json"
_MARK = "brachis_sweep"


def arrow() -> ModuleType:
    """Import pyarrow.

    Raises
    ------
    NotInstalledError
        It is not.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415  (an extra, and only sweeps need it)
        import pyarrow.csv  # noqa: PLC0415
        import pyarrow.parquet  # noqa: PLC0415
    except ImportError as error:
        raise NotInstalledError("a sweep", "pyarrow", "sweep") from error
    return pa


class Store:
    """The folder of a sweep.

    Parameters
    ----------
    folder : Path
        Made where there is none. One that holds other files than a sweep's is refused.

    Raises
    ------
    InputError
        The folder is not a sweep's, or cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._arrow = arrow()
        with writing_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            foreign = any(folder.iterdir()) and not self._is_ours()
        if foreign:
            problem = "the folder holds other files"
            raise InputError(problem, where=str(folder), allowed=f"a new folder, or one with a sweep's {_ABOUT}")

    def _is_ours(self) -> bool:
        try:
            return _MARK in json.loads(read_file(self.folder / _ABOUT))
        except (OSError, ValueError, TypeError):
            return False

    def describe(self, about: Mapping[str, Any]) -> None:
        """Write down what the folder is for."""
        with atomic_write(self.folder / _ABOUT) as stream:
            stream.write(json.dumps({_MARK: 1, **about}, indent=2).encode() + b"\n")

    def about(self) -> dict[str, Any]:
        """Return what was written down.

        Raises
        ------
        InputError
            The folder is not a sweep's.
        """
        if not self._is_ours():
            raise InputError("the folder is not a sweep's", where=str(self.folder), allowed=f"one with its {_ABOUT}")
        about: dict[str, Any] = json.loads(read_file(self.folder / _ABOUT))
        return about

    def _place(self, digest: str, suffix: str) -> Path:
        """Name a file; of folders with thousands of files every write would have to read the list."""
        return self.folder / "plans" / digest[:2] / f"{digest}{suffix}"

    def write(self, digest: str, outcome: Outcome) -> dict[str, Any]:
        """Store a finished plan; returns its columns."""
        motion, part = self._place(digest, ".npz"), self._place(digest, ".parquet")
        with writing_errors(part):
            part.parent.mkdir(parents=True, exist_ok=True)
        facts = {**dict.fromkeys(COLUMNS), **outcome.facts}
        if outcome.motion is not None:
            with atomic_write(motion) as stream:
                stream.write(outcome.motion)
            facts["motion"] = motion.relative_to(self.folder).as_posix()
        schema = self._arrow.schema(COLUMNS.items())
        with atomic_write(part) as stream:
            self._arrow.parquet.write_table(self._arrow.Table.from_pylist([facts], schema), stream)
        return facts

    def read(self, digest: str) -> dict[str, Any] | None:
        """Return the columns of a finished plan; None where it is not stored, or not as a whole."""
        try:
            content = read_file(self._place(digest, ".parquet"))
            table = self._arrow.parquet.read_table(self._arrow.BufferReader(content))
            (facts,) = table.to_pylist()
        except (OSError, ValueError, self._arrow.ArrowException):
            return None
        whole = set(facts) == set(COLUMNS) and (not facts["motion"] or is_file(self.folder / facts["motion"]))
        return facts if whole else None

    def table(self, keys: Sequence[str], rows: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> pa.Table:
        """Make the table of all plans.

        Parameters
        ----------
        keys : sequence of str
            Columns of what was varied.
        rows : sequence of (mapping, mapping)
            What a plan sets of them, and its columns.
        """
        pa = self._arrow
        varied = {key: _column([changes.get(key) for changes, _ in rows]) for key in keys}
        found = {name: pa.array([facts[name] for _, facts in rows], kind) for name, kind in COLUMNS.items()}
        return pa.table({"plan": pa.array(range(len(rows)), "int64"), **varied, **found})

    def write_table(self, table: pa.Table) -> None:
        """Write the table as Parquet and as CSV."""
        pa = self._arrow
        for name, write in zip(TABLES, (pa.parquet.write_table, pa.csv.write_csv), strict=True):
            with atomic_write(self.folder / name) as stream:
                write(table, stream)

    def read_table(self) -> pa.Table:
        """Read the table.

        Raises
        ------
        InputError
            There is none that can be read.
        """
        path = self.folder / TABLES[0]
        try:
            return self._arrow.parquet.read_table(path)
        except (OSError, self._arrow.ArrowException) as error:
            raise InputError("no table of a sweep", where=str(path), found=str(error)) from error


def _column(values: Sequence[Any]) -> list[Any]:
    """Return values of one kind as they are, and others, lists for example, as JSON."""
    kinds = {bool if isinstance(value, bool) else type(value) for value in values if value is not None}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) <= 1 and kinds <= {int, float, str, bool}:
        return list(values)
    return [None if value is None else json.dumps(value) for value in values]
