"""Figures that are allowed and hardly meant: degrees for rad, mm for m, g for kg. Warnings, and hints for errors."""

from brachis.plausibility.hints import check_within_reach, place_hint, position_hint, turn_hint
from brachis.plausibility.of_robot import of_robot
from brachis.plausibility.of_task import of_end_time, of_places, of_task
from brachis.plausibility.remark import PlausibilityWarning, Remark, tell

__all__ = [
    "PlausibilityWarning",
    "Remark",
    "check_within_reach",
    "of_end_time",
    "of_places",
    "of_robot",
    "of_task",
    "place_hint",
    "position_hint",
    "tell",
    "turn_hint",
]
