"""All tolerances that decide whether two numbers count as equal, with their units and reasons.

Use ``tolerances.LENGTH`` to ask whether a length is zero or equal to another one. Tolerances that a user may set (for
verification, a solver or a fit), and values found by measurement (a margin, the step of a finite difference), are
defined where they are used.
"""

from __future__ import annotations

LENGTH = 1e-9
"""Tolerance for lengths and positions, m.

No drive can move by a nanometre; the rounding error of 10 m is a million times smaller.
"""

ANGLE = 1e-9
"""Tolerance for angles, rad, sines, and entries of unit vectors and rotation matrices: `LENGTH` at a radius of 1 m."""

COORDINATE = 1e-9
"""Tolerance for quantities in m or rad: joint positions, task coordinates, and their derivatives by s."""

WRITTEN = 1e-6
"""Tolerance for figures that people or programs write into files with six or more digits; m, rad or relative."""

POSTURE = 1e-5
"""Tolerance for comparing solutions of inverse kinematics, rad or m: close to singularities, half the digits are lost.
"""

PATH = 1e-9
"""Tolerance for path coordinates s, dimensionless: equal to `LENGTH` on a path of 1 m."""

TIME = 1e-12
"""Tolerance for normalised times in [0, 1], such as knots: the rounding error of a few thousand operations."""

ROUNDING = 1e-12
"""Relative tolerance for a number computed in two ways: the rounding error of a few thousand operations."""

END_TIME = 1e-4
"""Relative tolerance for comparing end times: the accuracy of the refinement and of the solvers."""

GAIN = 2e-4
"""Fraction of the end time that further work must save to be worthwhile: twice `END_TIME`."""
