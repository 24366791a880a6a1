"""All tolerances that decide whether two figures count as equal, with units and reasons.

Use ``tolerances.LENGTH`` to ask whether a length is zero or equal to another one. Tolerances that a user may set (of a
verification, a solver or a fit), and figures that were measured (a margin, a step of differences), are defined where
they are used.
"""

from __future__ import annotations

LENGTH = 1e-9
"""Lengths and positions, m. No drive moves by a nanometre; the rounding of 10 m is a million times smaller."""

ANGLE = 1e-9
"""Angles, rad; also sines, and entries of unit vectors and rotation matrices: `LENGTH` at a radius of 1 m."""

COORDINATE = 1e-9
"""Quantities that are lengths or angles, m or rad: joint positions, task coordinates, and their change per unit s."""

WRITTEN = 1e-6
"""Figures that people or programs write into files, m, rad or relative: they have at least six digits."""

POSTURE = 1e-5
"""Joint positions of two solutions of inverse kinematics, rad or m: close to singularities, half the digits are
lost."""

PATH = 1e-9
"""Path coordinates s, dimensionless: equal to `LENGTH` on a path of 1 m."""

TIME = 1e-12
"""Normalised times in [0, 1], such as knots and collocation points: the rounding of a few thousand operations."""

ROUNDING = 1e-12
"""Figures that were computed in two ways, relative to their size or to 1: the rounding of a few thousand operations."""

END_TIME = 1e-4
"""End times of two motions, relative: the accuracy of refinement and of the solvers' tolerances."""

GAIN = 2e-4
"""Fraction of the end time that further work must save to be worthwhile: twice `END_TIME`."""
