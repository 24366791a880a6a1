"""Sweeps: planning a task many times, with its keys varied over grids, rows and random draws."""

from brachis.apps.sweeps.result import SweepResult
from brachis.apps.sweeps.run import sweep
from brachis.apps.sweeps.settings import SweepSettings

__all__ = ["SweepResult", "SweepSettings", "sweep"]
