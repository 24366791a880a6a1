"""A report on a motion: one HTML file with the information needed to decide whether to run the motion.

Examples
--------
>>> import brachis
>>> result = brachis.plan("scara3", brachis.examples.scara_line, redundant_joints=["j1"], intervals=8, effort="single")
>>> page = brachis.report.make_report(result)
>>> page.html[:15]
'<!doctype html>'
"""

from brachis.apps.report.page import Report, check_report_name, make_report

__all__ = ["Report", "check_report_name", "make_report"]
__dir__ = __all__.copy  # what tab completion shows
