"""Independent verification of a trajectory from URDF, path and limits alone."""

from brachis.verify.report import Check, Verification, VerifyOptions
from brachis.verify.verify import verify_trajectory

__all__ = ["Check", "Verification", "VerifyOptions", "verify_trajectory"]
