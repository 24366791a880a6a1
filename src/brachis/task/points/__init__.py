"""Paths from CAM: points and G-code are read and checked, and smooth curves are fitted within a tolerance.

The package works only on numbers, without task and robot; `brachis.task.fitted` turns its curves into segments.
"""
