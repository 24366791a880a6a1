"""Profiles of controllers: the units they expect, how they move between samples, and the limits they check.

Examples
--------
>>> from brachis.apps.controller import load_profile
>>> load_profile("kuka_rsi_4ms").period
0.004
"""

from brachis.apps.controller.axes import FACTORS, ControllerAxes, bind_axes
from brachis.apps.controller.limits import robot_with_profile
from brachis.apps.controller.profile import (
    Language,
    Profile,
    load_profile,
    profile_names,
)
from brachis.apps.controller.run import (
    RunReport,
    axes_for,
    nearest_on_path,
    verify_run,
    with_profile,
)

__all__ = [
    "FACTORS",
    "ControllerAxes",
    "Language",
    "Profile",
    "RunReport",
    "axes_for",
    "bind_axes",
    "load_profile",
    "nearest_on_path",
    "profile_names",
    "robot_with_profile",
    "verify_run",
    "with_profile",
]
