"""The prescribed path and its first three derivatives with respect to the path coordinate s."""

from brachis.path.build import (
    OffPathError,
    build_path,
    check_on_path,
    path_of,
    posture_hint,
)
from brachis.path.from_curve import bspline_segment, with_feed_rates
from brachis.path.legs import Leg, legs_of, with_held_speeds
from brachis.path.protocol import Curve, PathSample
from brachis.path.sequence import Path, check_closed, path_speed
from brachis.path.time_law import TimeLaw, time_law_of

__all__ = [
    "Curve",
    "Leg",
    "OffPathError",
    "Path",
    "PathSample",
    "TimeLaw",
    "bspline_segment",
    "build_path",
    "check_closed",
    "check_on_path",
    "legs_of",
    "path_of",
    "path_speed",
    "posture_hint",
    "time_law_of",
    "with_feed_rates",
    "with_held_speeds",
]
