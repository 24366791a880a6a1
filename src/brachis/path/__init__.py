"""The prescribed path and its derivatives by the path coordinate, up to the third."""

from brachis.path.build import build_path
from brachis.path.feed_table import FeedTable, feed_tables
from brachis.path.origin import check_on_path, path_of
from brachis.path.pose import PosePath
from brachis.path.protocol import Array, Curve, Path, PathSample
from brachis.path.sequence import SequencePath

__all__ = [
    "Array",
    "Curve",
    "FeedTable",
    "Path",
    "PathSample",
    "PosePath",
    "SequencePath",
    "build_path",
    "check_on_path",
    "feed_tables",
    "path_of",
]
