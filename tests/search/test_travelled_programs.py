"""Programs whose paths the planner may travel backwards, or begin elsewhere: known choices, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import PathError, TaskError
from brachis.task import load_task
from brachis.trajectory import part_rows

FREE = {"path_reversed": "free"}
CYCLE = {
    "start": [0.1, 0.0],
    "end": "start",
    "task_space": ["x", "y"],
    "effort": "single",
}
CIRCLE = {
    "path": [{"circle": {"center": [0.6, 0.4]}}],
    "path_start": [0.8, 0.4],
    "name": "circle",
}


def seam(y, name, **keys):
    return {
        "path": [{"line": {"by": [0.6, 0.0]}}],
        "path_start": [0.2, y],
        "name": name,
        **keys,
    }


def plan(program, order="free", **keys):
    return brachis.plan("gantry2", program=program, order=order, **{**CYCLE, **keys})


def test_parallel_seams_are_travelled_there_and_back(tmp_path):
    written = plan([seam(0.1, "near"), seam(0.3, "far")])
    events = [{"name": "on"}, {"name": "off", "at": "end"}]
    paths = [seam(0.1, "near", **FREE), seam(0.3, "far", **FREE, events=events)]
    result = plan(paths)
    assert result.verified
    assert result.t_end < 0.8 * written.t_end
    motion = result.trajectory
    parts = [part for part in motion.parts if part.kind == "path"]
    assert sorted(part.travel for part in parts) == ["", "reversed"]
    # The joints of a gantry are the coordinates of its tool.
    for part in parts:
        x = motion.position(np.array([part.begin, part.end]))[:, 0]
        ends = [0.8, 0.2] if part.travel else [0.2, 0.8]
        assert_allclose(x, ends, atol=1e-8)
    far = next(part for part in parts if part.name == "far")
    assert [event.time for event in motion.events] == [far.begin, far.end]
    assert any("path, reversed" in row for row in part_rows(motion.parts))
    assert "(reversed)" in result.summary()["parts"]
    result.save(tmp_path / "cycle.npz")
    loaded = brachis.Trajectory.load(tmp_path / "cycle.npz")
    assert loaded.parts == motion.parts
    assert brachis.verify_trajectory(loaded).passed
    assert load_task(loaded.task.to_dict()) == loaded.task


def test_a_circle_begins_where_the_program_is_fastest():
    """Against all places and directions, each planned for itself."""
    near = {**seam(0.1, "near"), "path_reversed": True}
    free = plan([near, {**CIRCLE, **FREE, "path_begin": "free"}])
    assert free.verified
    times = [
        plan([near, {**CIRCLE, "path_begin": k / 8, "path_reversed": turn}]).t_end
        for k in range(8)
        for turn in (False, True)
    ]
    assert free.t_end < min(times) * (1.0 + 1e-3)
    assert free.t_end < 0.97 * times[0]
    (circle,) = (part for part in free.trajectory.parts if part.name == "circle")
    assert circle.travel.startswith("from s = ")


def test_a_polygon_begins_at_the_corner_that_is_nearest():
    sides = ([-0.2, 0.0], [0.0, -0.2], [0.2, 0.0], [0.0, 0.2])
    square = {
        "path": [{"line": {"by": by}, "stop": True} for by in sides[:3]]
        + [{"line": {"by": sides[3]}}],
        "path_start": [0.6, 0.4],
        "path_begin": "free",
        "name": "square",
    }
    result = plan([{"move": "next"}, square, {"move": {"joints": [0.1, 0.0]}}], "given")
    assert result.verified
    begin, component = result.trajectory.components[1]
    assert component.task.path_begin == 0.5
    assert_allclose(result.trajectory.position(begin), [0.4, 0.2], atol=1e-8)
    assert len([phase for phase in component.phases if not phase.is_dwell]) == 4


def test_a_wait_after_a_path_stays_whichever_way_it_is_travelled():
    parts = [{"move": "next"}, seam(0.1, "near", **FREE), {"dwell": 0.2}]
    result = plan(
        [*parts, {"move": {"joints": [0.1, 0.0]}}],
        "given",
        start=[0.9, 0.1],
        end="free",
    )
    assert result.verified
    _, path, dwell, _ = result.trajectory.parts
    assert path.travel == "reversed"
    assert dwell.duration == pytest.approx(0.2)


@pytest.mark.parametrize(
    "program, order, text",
    [
        ([seam(0.1, "a", path_begin="free"), CIRCLE], "free", "only a closed path"),
        ([{"move": "next"}, seam(0.1, "a", **FREE), CIRCLE], "given", "between moves"),
        (
            [{"move": "next"}, seam(0.1, "a", path_reversed=True), {"retract": 0.1}],
            "given",
            "between moves",
        ),
        (
            [
                seam(
                    0.1,
                    "a",
                    **FREE,
                    tool_limits={"process_speed": [{"speed": 0.1, "s": [0.2, 0.8]}]},
                ),
                CIRCLE,
            ],
            "free",
            "values of s",
        ),
        ([seam(0.1, "a", path_reversed="maybe"), CIRCLE], "free", "path_reversed"),
    ],
)
def test_what_cannot_be_chosen_is_refused(program, order, text):
    with pytest.raises((TaskError, PathError), match=text):
        plan(program, order, end="free")
