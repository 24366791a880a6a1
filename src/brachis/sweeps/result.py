"""What a sweep gives: its table, and what can be read off it."""

from __future__ import annotations

import collections
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brachis.errors import InputError, UnknownNameError
from brachis.files import is_folder
from brachis.summary import Summary
from brachis.sweeps.settings import SweepSettings
from brachis.sweeps.store import TABLES, Store
from brachis.sweeps.worker import FAILED, UNVERIFIED, VERIFIED
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure


_MOST_AXES = 2


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Summary):
    """The plans of a sweep.

    Attributes
    ----------
    folder : Path
        Where plans and table are stored.
    keys : tuple of str
        Task keys that were varied.
    table : pyarrow.Table
        One row for each plan: ``plan`` (its number), the keys, and what came of it: ``status`` (verified, unverified or
        failed), ``t_end_s`` (s), ``worst_ratio`` (to a limit), ``path_error`` (m or rad), ``chosen_joints``,
        ``chosen_branch``, ``chosen_solver``, ``iterations``, ``wall_time_s`` (s), ``error`` (its class) and
        ``message``, ``remarks``, ``motion`` (its file in the folder). Values that are neither numbers nor strings are
        JSON.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> found = brachis.sweep(
    ...     {
    ...         "sweep": 1,
    ...         "task": "examples/01_scara_line.yaml",
    ...         "fixed": {"search.effort": "single"},
    ...         "grid": {"spline.intervals": [6, 7]},
    ...     },
    ...     tempfile.mkdtemp(),
    ...     jobs=1,
    ... )
    >>> [row["spline.intervals"] for row in found.ranked()]
    [7, 6]
    >>> round(found.trajectory(1).t_end, 1)
    2.8
    """

    folder: Path
    keys: tuple[str, ...]
    table: pa.Table

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> SweepResult:
        """Read the sweep that a folder holds.

        Raises
        ------
        InputError
            It holds none, or none that was finished.
        """
        path = Path(folder)
        if not is_folder(path):
            raise InputError("there is no such folder", where=str(path))
        store = Store(path)
        settings = SweepSettings.model_validate(store.about()["settings"])
        return cls(path, settings.keys, store.read_table())

    @property
    def varied(self) -> tuple[str, ...]:
        """Keys that take more than one value."""
        return tuple(key for key in self.keys if len(set(self.table.column(key).to_pylist())) > 1)

    @property
    def files(self) -> tuple[Path, ...]:
        """The table as Parquet and as CSV."""
        return tuple(self.folder / name for name in TABLES)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the table as a pandas data frame."""
        return self.table.to_pandas()

    def rows(self) -> list[dict[str, Any]]:
        """Return the table as a list of rows."""
        rows: list[dict[str, Any]] = self.table.to_pylist()
        return rows

    def trajectory(self, plan: int) -> Trajectory:
        """Load the motion of a plan.

        Parameters
        ----------
        plan : int
            Its number, from 0.

        Raises
        ------
        InputError
            There is no such plan, or it failed.
        """
        if not 0 <= plan < len(self.table):
            raise InputError("there is no such plan", found=plan, allowed=f"0 to {len(self.table) - 1}")
        row = self.table.slice(plan, 1).to_pylist()[0]
        if row["motion"] is None:
            raise InputError(f"plan {plan} failed", found=f"{row['error']}: {row['message']}")
        return Trajectory.load(self.folder / row["motion"])

    def ranked(self) -> list[dict[str, Any]]:
        """Return the rows of verified plans, the fastest first."""
        return sorted((row for row in self.rows() if row["status"] == VERIFIED), key=lambda row: row["t_end_s"])

    def count(self, status: str) -> int:
        """Count the plans of a status: verified, unverified or failed."""
        return self.table.column("status").to_pylist().count(status)

    def failures(self) -> dict[str, tuple[int, str]]:
        """Return, for each class of error, the commonest first, how many plans failed with it, and one message."""
        failed = [(row["error"], row["message"]) for row in self.rows() if row["status"] == FAILED]
        counts = collections.Counter(error for error, _ in failed)
        return {error: (count, dict(failed)[error]) for error, count in counts.most_common()}

    def summary(self) -> dict[str, Any]:
        """Return the sweep in short: numbers of plans, best, median and worst verified ones, failures by cause."""
        ranked = self.ranked()
        places = {"best": 0, "median": (len(ranked) - 1) // 2, "worst": -1} if ranked else {}
        return {
            "plans": len(self.table),
            **{status: self.count(status) for status in (VERIFIED, UNVERIFIED, FAILED)},
            **{
                name: {key: ranked[place][key] for key in ("plan", *self.keys, "t_end_s")}
                for name, place in places.items()
            },
            "failures": {
                error: {"plans": count, "message": message} for error, (count, message) in self.failures().items()
            },
            "wall_time_s": sum(filter(None, self.table.column("wall_time_s").to_pylist())),
        }

    def plot(self, keys: Sequence[str] | None = None) -> Figure:
        """Draw the end times of verified plans over one key, a line, or two, a heat map.

        Parameters
        ----------
        keys : sequence of str, optional
            One or two of the varied keys; by default the first two that take more than one value. Where plans differ
            in others too, the fastest of them is shown.

        Raises
        ------
        InputError
            No key varies, or no plan is verified.
        """
        from brachis.sweeps.figure import plot_sweep  # noqa: PLC0415  (matplotlib takes 0.7 s)

        for key in keys or ():
            if key not in self.varied:
                raise UnknownNameError("key that varies", key, self.varied, where="keys")
        return plot_sweep(self.rows(), tuple(keys or self.varied[:_MOST_AXES]))
