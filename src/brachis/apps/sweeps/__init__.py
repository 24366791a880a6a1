"""Many plans: a task whose keys are varied over grids, rows and random draws, planned in processes or on a cluster."""

from brachis.apps.sweeps.result import SweepResult
from brachis.apps.sweeps.run import sweep
from brachis.apps.sweeps.settings import SweepSettings

__all__ = ["SweepResult", "SweepSettings", "sweep"]
