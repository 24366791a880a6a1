"""Export of trajectories to other programs. Each format is a function in this package and a row of `FORMATS`.

Examples
--------
>>> import brachis
>>> "csv" in brachis.export.FORMATS
True
"""

from brachis.apps.export.controllers import TOPIC
from brachis.apps.export.for_controller import (
    PROGRAM,
    RunWarning,
    write_for_controller,
)
from brachis.apps.export.formats import FORMATS, Format, format_of, write
from brachis.apps.export.programs import ProgramReport
from brachis.apps.export.rows import LeftOutWarning
from brachis.apps.export.tables import SCHEMA_ID, samples_schema

__all__ = [
    "FORMATS",
    "PROGRAM",
    "SCHEMA_ID",
    "TOPIC",
    "Format",
    "LeftOutWarning",
    "ProgramReport",
    "RunWarning",
    "format_of",
    "samples_schema",
    "write",
    "write_for_controller",
]
__dir__ = __all__.copy  # names offered for completion
