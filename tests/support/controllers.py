"""Start postures of motions for controllers."""

RAIL_START = [0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]
SEVEN_START = [0.1, 0.5, 0.2, -1.2, 0.1, 0.8, 0.3]
