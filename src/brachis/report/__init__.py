"""A motion as one HTML file, from which a person decides whether to run it; `make_report` does the whole."""

from brachis.report.whole import Report, make_report

__all__ = ["Report", "make_report"]
