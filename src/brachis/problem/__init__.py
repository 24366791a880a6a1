"""A task on a robot: path, postures, choices of redundant joints; what is refused at once, and what is implausible."""
