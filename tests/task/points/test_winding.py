"""Winding and serpentine paths of ``benchmarks/winding_paths.py``, small ones: few knots, no turn taken for another.

The full count, 60, is ``benchmarks/winding_paths.py``.
"""

import pytest


@pytest.mark.parametrize("seed", [1, 5, 14, 20, 23, 28, 30, 37, 54])
def test_winding_paths_are_fitted_with_few_knots(bench, seed):
    winding_paths = bench("winding_paths")
    path = winding_paths.winding_path(seed, most_points=2_000)
    curves, intervals = winding_paths.fit(path)
    of_points, of_curve = winding_paths.deviations(path, curves, sides=2_000, count=500)
    assert len(curves) == 1
    assert of_points <= 1.001
    assert of_curve <= 1.1
    assert intervals <= 12 * path.turns


def test_a_raster_with_round_turns_takes_knots_where_it_bends(bench):
    winding_paths = bench("winding_paths")
    path = winding_paths.winding_path(45, most_points=2_000)
    assert path.kind == "raster"
    curves, intervals = winding_paths.fit(path)
    assert winding_paths.deviations(path, curves, sides=2_000, count=500)[0] <= 1.001
    assert intervals <= 20 * path.turns
