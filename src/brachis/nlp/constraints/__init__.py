"""Constraints on the joint motion: one per file, listed in `TABLE`."""

from brachis.nlp.constraints import branch_margin, joint_rate, position, torque
from brachis.nlp.constraints.protocol import Build, Constraint, Partials

TABLE: dict[str, Build] = {
    "torque": torque.build,
    "velocity": joint_rate.build_velocity,
    "acceleration": joint_rate.build_acceleration,
    "position": position.build,
    "branch_margin": branch_margin.build,
}

__all__ = ["TABLE", "Constraint", "Partials"]
