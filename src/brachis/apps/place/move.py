"""Moves a workpiece or the base, within ranges, to where the motion is faster.

The end time jumps where another branch or another way round an obstacle becomes the best, and it falls smoothly between
the jumps. So plans at seeded places find good regions. From the best of them, steps against the gradient follow, which
comes from the multipliers of each plan. A step that gives no faster motion is shortened. Each step starts from the
motion before it, so that it stays in its region.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Unpack

from brachis.apps.place.placing import Placing, check_ranges
from brachis.apps.place.search import WORKPIECE, PlaceSearch
from brachis.common.arguments import count
from brachis.common.progress import Listener, report_progress
from brachis.planner import plan, read_arguments
from brachis.robot import Robot
from brachis.task import Source, TaskKeywords

_DESCENTS = 2
"""Number of places from which steps are taken."""


def place(
    robot_or_task: Source | Robot | None = None,
    /,
    task: Source | None = None,
    *,
    move: str = WORKPIECE,
    ranges: Mapping[str, tuple[float, float]],
    starts: int = 4,
    steps: int = 8,
    jobs: int = 1,
    listener: Listener | None = None,
    progress: bool | None = None,
    **keywords: Unpack[TaskKeywords],
) -> Placing:
    """Move a workpiece or the base to where the motion is faster.

    Parameters
    ----------
    robot_or_task, task
        As for `brachis.plan`.
    move : str, optional
        Name of a frame of the task, ``base``, or ``workpiece`` for the frame of all paths. Bodies of the scene that are
        placed in the frame move with it. If the paths are given in the world, a frame is added to the task.
    ranges : mapping of str to (float, float)
        Smallest change, at most 0, and largest change, at least 0, of each coordinate: ``x``, ``y`` and ``z`` along the
        axes of the world, m; ``roll_deg``, ``pitch_deg`` and ``yaw_deg`` about them, degrees. Other coordinates stay.
    starts : int, optional
        Number of places that are tried first, the present one included.
    steps : int, optional
        Maximum number of steps from each of the best two places.
    jobs : int, optional
        Number of processes for the first places.
    listener, progress, **keywords
        As for `brachis.plan`.

    Returns
    -------
    Placing

    Raises
    ------
    InputError
        The task or a range is wrong, or a given posture holds the path in its place.
    PlanningError
        The task as it is has no plan.

    Examples
    --------
    >>> import brachis
    >>> placing = brachis.place(
    ...     "scara3",
    ...     start="free",
    ...     path_start=[1.5, -0.3],
    ...     path=brachis.Line(by=[0.0, 0.6]),
    ...     task_space=["x", "y"],
    ...     ranges={"x": (-0.2, 0.2)},
    ...     starts=1,
    ...     steps=1,
    ... )
    >>> placing.after.t_end <= placing.before.t_end
    True
    """
    check_ranges(ranges)
    with report_progress(listener, progress) as report:
        robot, loaded = read_arguments(robot_or_task, task, keywords)
        search = PlaceSearch.of(robot, loaded, move, ranges, report)
        report("planning the task as it is")
        before = plan(robot, search.task, listener=listener, progress=False)
        start_places = []
        if count(starts, "starts") > 1:
            from scipy.stats import qmc

            sampler = qmc.Halton(len(ranges), seed=loaded.search.seed)
            start_places = list(sampler.random(starts - 1))
        candidates = search.plan_starts(robot, start_places, before, jobs)
        candidates = sorted(candidates, key=lambda candidate: candidate[1].t_end)
        reached = [
            search.descend(robot, *candidate, steps)
            for candidate in candidates[:_DESCENTS]
        ]
        place_found, after = min(
            reached, key=lambda pair: pair[1].t_end, default=(search.present, before)
        )
        if after is not before:
            report("planning the task at the best place")
            final = search.plan_at(robot, place_found, is_final=True)
            if final is not None and final.t_end < after.t_end:
                after = final
    return Placing(
        moved=search.moved,
        change=search.change_at(place_found),
        task=search.task_at(place_found),
        before=before,
        after=after,
        trials=tuple(search.trials),
    )
