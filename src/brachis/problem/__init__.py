"""A task bound to a robot: path, postures, choices of redundant joints, and checks of the task and the robot."""
