"""Trajectories in the formats of other programs; a format is one file here and one line in `FORMATS`.

Examples
--------
>>> import brachis
>>> "csv" in brachis.export.FORMATS
True
"""

from brachis.export.csv_table import export_csv
from brachis.export.formats import FORMATS, Exporter, Format, format_of, write
from brachis.export.gif import export_gif
from brachis.export.json_samples import SCHEMA_ID, export_json, samples_schema
from brachis.export.mcap_bag import TOPIC, export_mcap
from brachis.export.mp4 import export_mp4
from brachis.export.parquet_table import export_parquet
from brachis.export.ros2_yaml import export_ros2_yaml
from brachis.export.rows import LeftOutWarning
from brachis.export.urscript import export_urscript

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
