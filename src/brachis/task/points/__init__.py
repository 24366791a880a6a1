"""Paths from CAM: reading and checking tables of points and G-code, and fitting smooth curves within a tolerance.

The package works on numbers alone and knows neither task nor robot; `brachis.task.fitted` makes segments of its curves.
"""
