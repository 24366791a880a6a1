"""The result of a sweep: the folder, in which every finished plan has its own files, and the table of all plans.

``plans/3f/3f0a....parquet`` contains one row of the table, and ``plans/3f/3f0a....npz`` the motion of this row. Files
are written under temporary names and then renamed, so that a file is either complete or missing. The motion is written
before the row, so that every row belongs to a finished plan.
"""

from __future__ import annotations

import collections
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brachis.apps.export.rows import require_library
from brachis.apps.sweeps.plans import FAILED, UNVERIFIED, VERIFIED, PlanOutcome
from brachis.apps.sweeps.settings import SweepSettings
from brachis.common.files import (
    atomic_write,
    is_file,
    read_file,
    writing_errors,
)
from brachis.common.summary import Summary
from brachis.errors import InputError, UnknownNameError
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure

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
"""Columns of an outcome, with Arrow types.

Times are in s. The path error is the larger of its two values in m and in rad.
"""
TABLE = "table"
"""File name of the table of all plans, without its suffix."""
_ABOUT = "sweep.json"
_MARK = "brachis_sweep"


def read_description(folder: Path) -> dict[str, Any] | None:
    """Return the description that a sweep wrote into its folder; None if the folder contains no sweep."""
    try:
        about: dict[str, Any] = json.loads(read_file(folder / _ABOUT))
        is_ours = _MARK in about
    except (OSError, ValueError, TypeError):
        return None
    return about if is_ours else None


class Store:
    """The folder of a sweep.

    Parameters
    ----------
    folder : Path
        Folder to use; it is created if it does not exist. If the folder contains files that do not belong to a sweep,
        this gives an error.

    Raises
    ------
    InputError
        The folder does not belong to a sweep or cannot be written to; or pyarrow is not installed
        (`NotInstalledError`).
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._arrow = require_library("pyarrow", "a sweep", extra="sweep")
        self._parquet = require_library("pyarrow.parquet", "a sweep", extra="sweep")
        with writing_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            is_foreign = any(folder.iterdir()) and read_description(folder) is None
        if is_foreign:
            raise InputError(
                "the folder contains other files",
                where=str(folder),
                allowed=f"a new folder, or one with the {_ABOUT} of a sweep",
            )

    def describe(self, about: Mapping[str, Any]) -> None:
        """Write the description of the sweep into the folder."""
        with atomic_write(self.folder / _ABOUT) as stream:
            stream.write(json.dumps({_MARK: 1, **about}, indent=2).encode() + b"\n")

    def _place(self, digest: str, suffix: str) -> Path:
        """Return the path of a plan's file in one of 256 folders; writing to folders with many files is slow."""
        return self.folder / "plans" / digest[:2] / f"{digest}{suffix}"

    def write(self, digest: str, outcome: PlanOutcome) -> dict[str, Any]:
        """Store a finished plan and return its columns."""
        motion = self._place(digest, ".npz")
        columns_file = self._place(digest, ".parquet")
        with writing_errors(columns_file):
            columns_file.parent.mkdir(parents=True, exist_ok=True)
        facts = {**dict.fromkeys(COLUMNS), **outcome.facts}
        if outcome.motion is not None:
            with atomic_write(motion) as stream:
                stream.write(outcome.motion)
            facts["motion"] = motion.relative_to(self.folder).as_posix()
        schema = self._arrow.schema(COLUMNS.items())
        with atomic_write(columns_file) as stream:
            table = self._arrow.Table.from_pylist([facts], schema)
            self._parquet.write_table(table, stream)
        return facts

    def read(self, digest: str) -> dict[str, Any] | None:
        """Return the columns of a finished plan; None if the plan is not stored completely."""
        try:
            content = read_file(self._place(digest, ".parquet"))
            table = self._parquet.read_table(self._arrow.BufferReader(content))
            (facts,) = table.to_pylist()
        except (OSError, ValueError, self._arrow.ArrowException):
            return None
        if set(facts) != set(COLUMNS):
            return None
        motion = facts["motion"]
        return facts if not motion or is_file(self.folder / motion) else None

    def write_table(
        self,
        keys: Sequence[str],
        rows: Mapping[int, tuple[Mapping[str, Any], Mapping[str, Any]]],
        name: str,
    ) -> pa.Table:
        """Write a table of plans as Parquet and as CSV, and return it.

        Parameters
        ----------
        keys : sequence of str
            Keys of the task that were varied.
        rows : mapping of int to (mapping, mapping)
            Values of these keys, and columns of the outcome, by the number of the plan. Missing columns are null.
        name : str
            Name of the files, without their suffixes.
        """
        from pyarrow import csv

        columns: dict[str, Any] = {"plan": list(rows)}
        for key in keys:
            columns[key] = _column([changes.get(key) for changes, _ in rows.values()])
        for title, kind in COLUMNS.items():
            column = [facts.get(title) for _, facts in rows.values()]
            columns[title] = self._arrow.array(column, kind)
        table = self._arrow.table(columns)
        writers = {"parquet": self._parquet.write_table, "csv": csv.write_csv}
        for suffix, write in writers.items():
            with atomic_write(self.folder / f"{name}.{suffix}") as stream:
                write(table, stream)
        return table

    def read_table(self) -> pa.Table:
        """Read the table of all plans.

        Raises
        ------
        InputError
            The table is missing or cannot be read.
        """
        path = self.folder / f"{TABLE}.parquet"
        try:
            return self._parquet.read_table(path)
        except (OSError, self._arrow.ArrowException) as error:
            raise InputError(
                "the file is not the table of a sweep",
                where=str(path),
                found=str(error),
            ) from error


def _column(values: Sequence[Any]) -> list[Any]:
    """Return numbers, texts and booleans as they are, and other values, for example lists, as JSON."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) <= 1 and kinds <= {int, float, str, bool}:
        return list(values)
    return [None if value is None else json.dumps(value) for value in values]


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Summary):
    """The plans of a sweep.

    Attributes
    ----------
    folder : Path
        Folder in which the plans and the table are stored.
    keys : tuple of str
        Task keys that were varied.
    table : pyarrow.Table
        One row for each plan: ``plan`` (its number), the keys, and the outcome: ``status`` (verified, unverified or
        failed), ``t_end_s`` (s), ``worst_ratio`` (to a limit), ``path_error`` (m or rad), ``chosen_joints``,
        ``chosen_branch``, ``chosen_solver``, ``iterations``, ``wall_time_s`` (s), ``error`` (its class) and
        ``message``, ``remarks``, ``motion`` (its file in the folder). Values that are neither numbers nor strings are
        written as JSON.
    name : str
        Name of the table's files, without their suffixes: ``table``, unless only a part of the sweep was run.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.sweep(
    ...     {
    ...         "sweep": 1,
    ...         "task": "examples/01_scara_line.yaml",
    ...         "fixed": {"search.effort": "single"},
    ...         "grid": {"spline.intervals": [6, 7]},
    ...     },
    ...     tempfile.mkdtemp(),
    ...     jobs=1,
    ... )
    >>> [row["spline.intervals"] for row in result.ranked()]
    [7, 6]
    >>> round(result.trajectory(1).t_end, 1)
    2.8
    """

    folder: Path
    keys: tuple[str, ...]
    table: pa.Table
    name: str = TABLE

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> SweepResult:
        """Read the sweep in a folder.

        Raises
        ------
        InputError
            The folder contains no sweep, or an unfinished one.
        """
        path = Path(folder)
        about = read_description(path)
        if about is None:
            raise InputError(
                "the folder contains no sweep",
                where=str(path),
                allowed=f"a folder with the {_ABOUT} of a sweep",
            )
        settings = SweepSettings.model_validate(about["settings"])
        return cls(path, settings.keys, Store(path).read_table())

    @property
    def varied(self) -> tuple[str, ...]:
        """Varied keys that have more than one value."""
        return tuple(
            key for key in self.keys if len(self.table.column(key).unique()) > 1
        )

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that contain the table, as Parquet and as CSV."""
        return tuple(
            self.folder / f"{self.name}.{suffix}" for suffix in ("parquet", "csv")
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the table as a pandas data frame."""
        return self.table.to_pandas()

    def rows(self) -> list[dict[str, Any]]:
        """Return the table as a list of rows."""
        return list(self.table.to_pylist())

    def trajectory(self, plan: int) -> Trajectory:
        """Load the motion of a plan.

        Parameters
        ----------
        plan : int
            Number of the plan, from 0.

        Raises
        ------
        InputError
            The number is too large, or the plan failed.
        """
        if not 0 <= plan < len(self.table):
            raise InputError(
                "the plan does not exist",
                found=plan,
                allowed=f"0 to {len(self.table) - 1}",
            )
        row = self.table.slice(plan, 1).to_pylist()[0]
        if row["motion"] is None:
            raise InputError(
                f"plan {plan} failed", found=f"{row['error']}: {row['message']}"
            )
        return Trajectory.load(self.folder / row["motion"])

    def ranked(self) -> list[dict[str, Any]]:
        """Return the rows of verified plans, beginning with the fastest."""
        verified = [row for row in self.rows() if row["status"] == VERIFIED]
        return sorted(verified, key=lambda row: row["t_end_s"])

    def count(self, status: str) -> int:
        """Count the plans with a status: verified, unverified or failed."""
        return self.table.column("status").to_pylist().count(status)

    def failures(self) -> dict[str, tuple[int, str]]:
        """Return the number of failed plans and one message for each class of error; the commonest comes first."""
        failed = [row for row in self.rows() if row["status"] == FAILED]
        counts = collections.Counter(row["error"] for row in failed)
        messages = {row["error"]: row["message"] for row in failed}
        return {
            error: (count, messages[error]) for error, count in counts.most_common()
        }

    def summary(self) -> dict[str, Any]:
        """Summarise the sweep: the numbers of plans; the best, median and worst verified plan; and failures by cause.

        For an even number of plans, the median is the faster of the two plans in the middle.
        """
        ranked = self.ranked()
        summary: dict[str, Any] = {"plans": len(self.table)}
        for status in (VERIFIED, UNVERIFIED, FAILED):
            summary[status] = self.count(status)
        if ranked:
            median = ranked[(len(ranked) - 1) // 2]
            shown = {"best": ranked[0], "median": median, "worst": ranked[-1]}
            for name, row in shown.items():
                summary[name] = {
                    key: row[key] for key in ("plan", *self.keys, "t_end_s")
                }
        summary["failures"] = {
            error: {"plans": count, "message": message}
            for error, (count, message) in self.failures().items()
        }
        times = self.table.column("wall_time_s").to_pylist()
        return {**summary, "wall_time_s": sum(filter(None, times))}

    def plot(self, keys: Sequence[str] | None = None) -> Figure:
        """Draw the end times of verified plans over one key, as a line, or over two keys, as a heat map.

        Parameters
        ----------
        keys : sequence of str, optional
            One or two of the varied keys. Default: the first two keys with more than one value. If plans also differ in
            other keys, the fastest of these plans is shown.

        Raises
        ------
        InputError
            No key varies, or no plan is verified.
        """
        from brachis.apps.sweeps.figure import plot_sweep

        for key in keys or ():
            if key not in self.varied:
                raise UnknownNameError("varied key", key, self.varied, where="keys")
        return plot_sweep(self.rows(), tuple(keys or self.varied[:2]))
