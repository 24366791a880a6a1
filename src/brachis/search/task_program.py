"""The program of a task with an initial guess, for the user's own solver."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from brachis.common.arguments import check_array, check_finite
from brachis.errors import PathError
from brachis.optimise.extraction import extract_trajectory
from brachis.optimise.program import Program
from brachis.optimise.transcription import program_of
from brachis.search.phase_plane import initial_guess
from brachis.search.stages import InitialGuess
from brachis.trajectory import Trajectory


class TaskProgram(Program):
    """A `Program` with a first point x, and the trajectory of any point x.

    A solver needs ``guess``, ``x_lower``, ``x_upper``, ``lower``, ``upper`` and the methods ``objective``,
    ``gradient``, ``rows`` and ``jacobian``, whose entries stand at ``jacobian_rows`` and ``jacobian_columns``. The
    methods raise `UnreachableError` at points x at which the arm cannot reach the path: there a solver has to shorten
    its step.

    Parameters
    ----------
    guess : InitialGuess
        Joint path, with its coordinates, through which the splines of the first point are laid.
    """

    def __init__(self, guess: InitialGuess) -> None:
        program = program_of(guess.problem, guess.maps_by_leg())
        spline = guess.problem.task.spline
        if spline.knots == "free":
            program = program.with_free_knots(spline.shortest_interval)
        super().__init__(program.phases, program.links)
        self._path_guess = guess

    @cached_property
    def guess(self) -> np.ndarray:
        """A first point x, (v,): splines through a joint path, slow enough to meet the limits that grow with speed.

        Raises
        ------
        PathError
            The splines leave the branch.
        """
        x = initial_guess(self, self._path_guess)
        if x is None:
            raise PathError(
                "the splines through the joint path leave the branch, or the chart",
                hint="Try more knot intervals (spline.intervals)",
            )
        return x

    def trajectory(self, x: np.ndarray) -> Trajectory:
        """Return the motion of a point x, to be saved, sampled and given to `brachis.verify_trajectory`.

        Parameters
        ----------
        x : (v,) ndarray
            A point within its bounds.

        Raises
        ------
        InputError
            `x` is not an array of finite numbers of this shape.
        UnreachableError
            The motion leaves the branch.
        """
        check_array(x, (self.variables,), "x")
        check_finite(x, "x")
        return extract_trajectory(self._path_guess.problem.task, self, x)
