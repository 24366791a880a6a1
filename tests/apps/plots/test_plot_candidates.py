"""Times along joint paths are compared with those of motions as finishing would make them."""

import math

import pytest

from brachis.apps.plots import plot_candidates
from brachis.errors import InputError
from brachis.search.stages import RANKED, Candidate


def candidate(joint, estimate, t_end=math.inf, *, verified=False, status=RANKED):
    """A candidate with times of its own."""

    class Made(Candidate):
        pass

    Made.t_end, Made.verified = property(lambda _: t_end), property(lambda _: verified)
    return Made(
        redundant_joints=(joint,),
        branch="elbow_up",
        origin="lattice 1",
        solver="uno",
        estimate=estimate,
        status=status,
    )


def marks_of(candidates):
    """Times by the labels of the marks."""
    (ax,) = plot_candidates(candidates).axes
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    times = [marks.get_offsets()[:, 0].tolist() for marks in ax.collections]
    return dict(zip(labels, times, strict=True))


def times_of(marks, words):
    (times,) = (marks[label] for label in marks if label.startswith(words))
    return times


@pytest.mark.parametrize("t_end", [2.002, 1.9])
def test_no_unfinished_one_is_left_of_the_fastest_for_its_estimate(t_end):
    """Finishing the fastest made its time longer, or splines of better knots shorter: so it would with the others."""
    fastest = candidate("j1", 2.0, t_end, verified=True)
    marks = marks_of([fastest, candidate("j2", 2.0005), candidate("j3", 2.5)])
    (star,) = marks["the fastest"]
    assert star == t_end
    unfinished = times_of(marks, "not finished")
    assert unfinished == pytest.approx([2.0005 * t_end / 2.0, 2.5 * t_end / 2.0])
    assert min(unfinished) > star


def test_refined_times_are_drawn_as_they_are():
    fastest = candidate("j1", 2.0, 2.002, verified=True)
    marks = marks_of(
        [
            fastest,
            candidate("j2", 2.3, 2.4, verified=True),
            candidate("j3", 2.1, 2.2, status="too fast"),
        ]
    )
    assert marks["refined and verified"] == [2.4]
    assert times_of(marks, "no verified") == [2.2]


def test_without_a_motion_times_stay_as_they_are():
    marks = marks_of(
        [candidate("j1", 2.0), candidate("j2", math.inf, status="out of reach")]
    )
    assert times_of(marks, "not finished") == [2.0]


def test_nothing_to_draw_is_an_error():
    with pytest.raises(InputError, match="the list of candidates is empty"):
        plot_candidates([])
