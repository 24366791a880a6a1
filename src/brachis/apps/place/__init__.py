"""Moving a workpiece or the base to where the motion is faster."""

from brachis.apps.place.move import place
from brachis.apps.place.placing import (
    Placing,
    Trial,
    read_range,
    write_end_time,
    write_task,
)
from brachis.apps.place.search import WORKPIECE

__all__ = [
    "WORKPIECE",
    "Placing",
    "Trial",
    "place",
    "read_range",
    "write_end_time",
    "write_task",
]
