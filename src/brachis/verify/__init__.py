"""Independent verification of a trajectory, based only on URDF, path and limits."""

from brachis.verify.report import POSITION_SCALE, Check, Verification, VerifyOptions
from brachis.verify.verify import verify_trajectory

__all__ = [
    "POSITION_SCALE",
    "Check",
    "Verification",
    "VerifyOptions",
    "verify_trajectory",
]
