"""Many plans: a task whose keys are varied over grids, rows and random draws, planned in processes or on a cluster."""

from brachis.sweeps.result import SweepResult
from brachis.sweeps.run import sweep
from brachis.sweeps.settings import SweepSettings

__all__ = ["SweepResult", "SweepSettings", "sweep"]
