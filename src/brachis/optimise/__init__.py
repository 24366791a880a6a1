"""The optimisation: a nonlinear program in phases, its meshes, its solvers, and the refinement of its solutions."""
