"""Trajectories in the formats of other programs; a format is one file here and one line in `FORMATS`.

Examples
--------
>>> import brachis
>>> "csv" in brachis.export.FORMATS
True
"""

from brachis.apps.export.animation import export_gif, export_mp4
from brachis.apps.export.controllers import (
    TOPIC,
    export_mcap,
    export_ros2_yaml,
    export_urscript,
)
from brachis.apps.export.formats import FORMATS, Exporter, Format, format_of, write
from brachis.apps.export.rows import LeftOutWarning
from brachis.apps.export.tables import (
    SCHEMA_ID,
    export_csv,
    export_json,
    export_parquet,
    samples_schema,
)

__all__ = [
    "FORMATS",
    "SCHEMA_ID",
    "TOPIC",
    "Exporter",
    "Format",
    "LeftOutWarning",
    "export_csv",
    "export_gif",
    "export_json",
    "export_mcap",
    "export_mp4",
    "export_parquet",
    "export_ros2_yaml",
    "export_urscript",
    "format_of",
    "samples_schema",
    "write",
]
