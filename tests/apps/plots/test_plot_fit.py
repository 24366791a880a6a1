"""The figure of fit errors shows the report's profile, tolerances and corners."""

import dataclasses

import numpy as np
import pytest

from brachis.apps.plots import plot_fit
from brachis.errors import InputError
from brachis.task import fit_path
from support.seams import bent, wave


def test_the_figure_has_errors_tolerances_and_corners(line_trajectory):
    position, _ = bent(3_000, 1e-5)
    segments = fit_path(position, tolerance={"position": "0.1 mm"})
    task = line_trajectory.task.model_copy(update={"path": segments})
    figure = plot_fit(dataclasses.replace(line_trajectory, task=task))
    (ax,) = figure.axes
    errors, tolerance, *corners = ax.get_lines()
    assert errors.get_ydata().max() == pytest.approx(1e3 * task.fits[0].position_error)
    assert errors.get_ydata().max() <= 0.1
    assert tolerance.get_ydata()[0] == pytest.approx(0.1)
    np.testing.assert_allclose(
        [line.get_xdata()[0] for line in corners],
        [300.0, 300.0 + 100.0 * np.pi],
        atol=1.0,
    )


def test_angles_have_an_axis_of_their_own(line_trajectory):
    position = wave(200)
    yaw = np.sin(3.0 * np.linspace(0.0, 1.0, 200))
    segments = fit_path(
        position[:, :2],
        orientations=yaw,
        tolerance={"position": "0.1 mm", "orientation": "0.2 deg"},
    )
    task = line_trajectory.task.model_copy(update={"path": segments})
    _, beside = plot_fit(dataclasses.replace(line_trajectory, task=task)).axes
    angles, tolerance = beside.get_lines()
    assert angles.get_ydata().max() <= tolerance.get_ydata()[0] == pytest.approx(0.2)


def test_a_path_that_was_not_fitted_is_an_error(line_trajectory):
    with pytest.raises(InputError, match="the path was not fitted"):
        plot_fit(line_trajectory)
