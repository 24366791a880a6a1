"""Paths as CAM gives them: tables of points and G-code, read, checked, and fitted by smooth curves within a tolerance.

It works on numbers alone and knows neither task nor robot; `brachis.task.fitted` makes segments of what it gives.
"""
