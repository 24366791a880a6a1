"""Bodies that are there only during some parts of a program count only in these, in the panel of distances."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.apps.plots.panels import panels_of, tool_rows_of
from brachis.task import task_with


def test_the_distance_is_that_to_the_bodies_of_the_part(cycle):
    tip = {"name": "tip", "sphere": 0.01, "link": "tool", "position": [0, 0, 0.3]}
    names = ("base", "bridge", "tool")
    pairs = [[name, "tip"] for name in names] + [["base", "tool"]]
    collisions = {"mode": "avoid", "capsules": "auto", "disable": pairs}
    places = ([0.45, 0.35, 0.3], [2.0, 2.0, 0.3])
    components = []
    for begin, part in cycle.trajectory.components:
        place = places[begin == 0.0]
        post = {"name": "post", "sphere": 0.02, "position": place}
        task = task_with(part.task, scene=[post, tip], collisions=collisions)
        components.append((begin, replace(part, task=task)))
    motion = replace(cycle.trajectory, components=tuple(components))
    assert tool_rows_of(motion) == ("tool speed", "clearance")
    samples = motion.at(np.array([0.1, motion.t_end - 0.1]))
    (panel,) = panels_of(motion, samples, "clearance")
    far, near = panel.curves[0].values
    (to_post,) = np.linalg.norm(samples.tool_position[1:, :2] - places[0][:2], axis=1)
    assert near <= to_post - 0.03 + 1e-6
    assert far > 1.0 > near == pytest.approx(to_post - 0.03, abs=0.2)
