"""Independent verification of a trajectory from URDF, path and limits alone."""

from brachis.verify.report import POSITION_SCALE, Check, Verification, VerifyOptions
from brachis.verify.verify import verify_trajectory

__all__ = [
    "POSITION_SCALE",
    "Check",
    "Verification",
    "VerifyOptions",
    "verify_trajectory",
]
