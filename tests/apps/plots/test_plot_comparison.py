import math

import pytest

from brachis.apps.plots import plot_comparison
from brachis.errors import InputError


def heights(ax):
    return {c.get_label(): [bar.get_height() for bar in c] for c in ax.containers}


def labels(ax):
    return [tick.get_text() for tick in ax.get_xticklabels()]


def test_bars_are_the_end_times():
    """Numbers ascend, with their unit; joints keep their order."""
    rows = [(9.5, "b", 3.0), (-4.0, "a", 1.0), (9.5, "a", 2.0), (-4.0, "b", 4.0)]
    (ax,) = plot_comparison(rows, unit=" kg").axes
    assert list(heights(ax).items()) == [("b", [4.0, 3.0]), ("a", [1.0, 2.0])]
    assert labels(ax) == ["-4 kg", "9.5 kg"]
    assert ax.get_ylim()[0] == 0.0


def test_any_cases_are_compared_in_their_order():
    rows = [
        ("seam", "rail, j1", 2.0),
        ("hem", "j1", 1.0),
        ("seam", "j1", 3.0),
        ("a circle", "rail, j1", 4.0),
    ]
    (ax,) = plot_comparison(rows, "path").axes
    assert labels(ax) == ["seam", "hem", "a circle"]
    assert ax.get_xlabel() == "path"
    assert heights(ax) == {"rail, j1": [2.0, 4.0], "j1": [3.0, 1.0]}


def test_every_value_is_written_above_its_bar_and_the_shortest_is_bold():
    (ax,) = plot_comparison(
        [(0.0, "j1", 2.0), (0.0, "j2", 1.5), (90.0, "j1", 1.25), (90.0, "j2", 3.0)]
    ).axes
    written = {text.get_text(): text for text in ax.texts}
    assert set(written) == {"2.000", "1.500", "1.250", "3.000"}
    weights = {label: text.get_fontweight() for label, text in written.items()}
    assert {label for label in weights if weights[label] == "bold"} == {
        "1.500",
        "1.250",
    }


def test_a_plan_that_was_not_found_is_said_and_a_missing_row_is_a_gap():
    (ax,) = plot_comparison(
        [(0.0, "j1", 2.0), (0.0, "j2", math.nan), (90.0, "j2", 3.0)]
    ).axes
    assert sorted(text.get_text() for text in ax.texts) == ["2.000", "3.000", "no plan"]
    assert heights(ax) == {"j1": [2.0], "j2": [3.0]}


@pytest.mark.parametrize(
    "rows, message, where",
    [
        ([], "the list of rows is empty", "rows"),
        ([(0.0, "j1", 2.0), (math.inf, "j1", 2.0)], "the row is not valid", "rows[1]"),
        ([(0.0, "j1", 0.0)], "the row is not valid", "rows[0]"),
        ([(0.0, "j1", math.inf)], "the row is not valid", "rows[0]"),
        ([(0.0, "j1", 1.0), (0.0, "j1", 2.0)], "already in another row", "rows[1]"),
    ],
)
def test_wrong_tables_are_errors(rows, message, where):
    with pytest.raises(InputError, match=message) as caught:
        plot_comparison(rows)
    assert caught.value.where == where
