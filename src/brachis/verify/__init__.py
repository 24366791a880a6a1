"""Independent verification of a trajectory from URDF, path and limits alone."""

from brachis.verify.report import Check, Verification
from brachis.verify.verify import VerifyOptions, verify

__all__ = ["Check", "Verification", "VerifyOptions", "verify"]
