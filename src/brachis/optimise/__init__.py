"""The optimisation: a nonlinear program in phases, its meshes and solvers, and the refinement of its solutions."""
