"""The words for a task space."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator

from brachis.task.fields import POSITION, ByForm, NonEmpty, must

Row = Literal["x", "y", "z", "roll", "pitch", "yaw", "axis"]
_SPACE_FORMS = (
    "a list of rows out of x, y, z and one of roll, pitch, yaw, axis; "
    "or one of position, pose, pose_free_roll, axis, joints"
)

EACH_ONCE = must(
    lambda names: len(set(names)) == len(names),
    "a name occurs twice",
    "each name once",
)
_ANGLE_LAST = must(
    lambda rows: {*rows[:-1]} <= {*POSITION},
    "only one row of rotation is possible, and it comes last",
    "for example [x, y, z, yaw] or [x, y, axis]",
)


def _name_space(space: str | tuple[str, ...]) -> str | tuple[str, ...]:
    """Give a task space one name, so that equal ones compare equal."""
    if space == (*POSITION, "axis"):
        return "pose_free_roll"
    return {"position": POSITION, "axis": ("axis",)}.get(str(space), space)


TaskSpace = Annotated[
    Literal["position", "pose", "pose_free_roll", "axis", "joints"]
    | Annotated[NonEmpty[Row], EACH_ONCE, _ANGLE_LAST],
    ByForm(_SPACE_FORMS),
    AfterValidator(_name_space),
]
