"""When two figures count as equal: all such tolerances, with unit and reason.

Use ``tolerances.LENGTH`` for "is it zero, is it the same". What a user may set (the tolerances of a verification, a
solver or a fit) and what is measured (a margin, a step of differences) stands where it is used.
"""

from __future__ import annotations

LENGTH = 1e-9
"""Lengths and positions, m. No drive moves by a nanometre; rounding of figures of 10 m is a million times smaller."""

ANGLE = 1e-9
"""Angles, rad; also their sines, and entries of unit vectors and rotation matrices: as `LENGTH` at a radius of 1 m."""

COORDINATE = 1e-9
"""Rows that are a length or an angle, m or rad: joint positions, task coordinates, and their change per unit of s."""

WRITTEN = 1e-6
"""Figures that people or programs write into files, m, rad or relative: they have six digits or more."""

POSTURE = 1e-5
"""Joint positions of two answers of inverse kinematics, rad or m: near singularities half of the digits are lost."""

PATH = 1e-9
"""Path coordinates s, dimensionless: on a path of 1 m the same as `LENGTH`."""

TIME = 1e-12
"""Normalised times in [0, 1], such as knots and collocation points: rounding after a few thousand operations."""

ROUNDING = 1e-12
"""Figures that were computed in two ways, relative to their size, or to 1: rounding after a few thousand operations."""

END_TIME = 1e-4
"""End times of two motions, relative: refinement and the solvers' tolerances leave so much open."""

GAIN = 2e-4
"""Fractions of the end time that further work has to save to be worth its time: twice `END_TIME`."""
