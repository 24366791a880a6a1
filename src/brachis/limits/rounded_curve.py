"""A piecewise linear curve that falls, made twice continuously differentiable from below.

With slopes m_k between the points of the curve, w_k half the width of the rounding of a corner at speed v_k, and the
curve taken as an even function of the velocity v,

    T(v) = T(0) + sum_k (m_k - m_{k-1}) (r((v - v_k) / w_k) + r((-v - v_k) / w_k)) w_k,        m_{-1} = 0,

where r(y) w is the ramp max(x, 0), x = w y, with its corner rounded between y = -1 and 1, nowhere below the ramp:

    r(y) = (3 + 8 y + 6 y^2 - y^4) / 16.

Where a curve falls ever more steeply this lies below it. A corner behind which it falls less steeply is first moved to
the left by w_k, on the line that follows it: the rounded part then ends at the corner itself. It is convex and neither
of its ends is above the curve, which is straight there; so nowhere is it above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.robot.torque_curves import Curve

WIDTH = 0.002
"""Half the width of a rounded corner, as a part of the shorter one of the pieces beside it."""
_NOTHING = 1e-9
"""Of the torque at rest: so little counts as none, and need not fall any further."""


@dataclass(frozen=True)
class RoundedCurve:
    """An even function of the velocity that lies below a curve.

    Attributes
    ----------
    at_rest : float
        Value at velocity 0, were the corner there not rounded.
    corners : (k,) ndarray
        Speeds of the corners, rad/s or m/s.
    widths : (k,) ndarray
        Half the widths of their rounding.
    bends : (k,) ndarray
        Changes of slope.
    """

    at_rest: float
    corners: np.ndarray
    widths: np.ndarray
    bends: np.ndarray

    @classmethod
    def below(cls, curve: Curve) -> RoundedCurve | None:
        """Round a curve; None where it does not fall.

        Its last slope goes on until no torque is left. A level beginning is left out, and the piece that follows it
        goes on to speed 0: the level itself is a plain torque limit.
        """
        speed, torque = np.array(curve).T
        slope = np.diff(torque) / np.diff(speed)
        if slope[-1] < 0.0 and torque[-1] > _NOTHING * torque[0]:
            speed, torque = np.append(speed, speed[-1] - torque[-1] / slope[-1]), np.append(torque, 0.0)
            slope = np.append(slope, slope[-1])
        if not np.any(slope < 0.0):
            return None
        first = int(np.argmax(slope < 0.0))
        lengths, slope = np.diff(speed), np.append(slope, 0.0)
        widths = WIDTH * np.minimum(np.append(lengths[0], lengths), np.append(lengths, lengths[-1]))
        moved = np.where(np.diff(slope, prepend=0.0) > 0.0, widths, 0.0)
        speed, torque = speed - moved, torque - slope * moved
        slope = np.append(np.diff(torque) / np.diff(speed), 0.0)[first:]
        corners = np.append(0.0, speed[first + 1 :])
        return cls(torque[first] - slope[0] * speed[first], corners, widths[first:], np.diff(slope, prepend=0.0))

    def values(self, velocity: np.ndarray) -> np.ndarray:
        """Values (K,) at velocities (K,)."""
        x = np.array([velocity, -velocity])[..., None] - self.corners
        y = np.clip(x / self.widths, -1.0, 1.0)
        ramp = self.widths * (3.0 + y * (8.0 + y * (6.0 - y * y))) / 16.0 + np.maximum(x - self.widths, 0.0)
        return np.asarray(self.at_rest + (ramp @ self.bends).sum(axis=0))

    def slopes(self, velocity: np.ndarray) -> np.ndarray:
        """Differentiate `values` by the velocities, (K,)."""
        y = np.clip((np.array([velocity, -velocity])[..., None] - self.corners) / self.widths, -1.0, 1.0)
        forward, backward = (2.0 + y * (3.0 - y * y)) @ self.bends / 4.0
        return np.asarray(forward - backward)
