"""The prescribed path and its derivatives by the path coordinate, up to the third."""

from brachis.path.build import build_path
from brachis.path.origin import check_on_path, path_of
from brachis.path.pose import PosePath
from brachis.path.protocol import Array, Curve, Path, PathSample
from brachis.path.sequence import SequencePath
from brachis.path.speed_table import SpeedTable, speed_tables

__all__ = [
    "Array",
    "Curve",
    "Path",
    "PathSample",
    "PosePath",
    "SequencePath",
    "SpeedTable",
    "build_path",
    "check_on_path",
    "path_of",
    "speed_tables",
]
