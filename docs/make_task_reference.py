"""Make docs/task_files.md from the task models with ``python docs/make_task_reference.py``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from brachis.task import (
    FrictionSettings,
    LimitScale,
    LimitSettings,
    RefinementSettings,
    RobotSettings,
    SolverSettings,
    SplineSettings,
    Task,
)
from brachis.task.segments import ArcCenter, ArcVia, Circle, LineBy, LineHeading, LineTo, SegmentModel, SplineThrough

PAGE = Path(__file__).parent / "task_files.md"

PARTS: dict[str, type[BaseModel]] = {
    "robot": RobotSettings,
    "robot.limits": LimitSettings,
    "robot.limits.scale": LimitScale,
    "robot.friction": FrictionSettings,
    "spline": SplineSettings,
    "solver": SolverSettings,
    "refinement": RefinementSettings,
}
SEGMENTS: dict[str, tuple[type[BaseModel], ...]] = {
    "line": (LineTo, LineBy, LineHeading),
    "arc": (ArcCenter, ArcVia),
    "circle": (Circle,),
    "spline": (SplineThrough,),
}
INTRODUCTION = """# Task files

<!-- Made by docs/make_task_reference.py. -->

A task file is YAML. Paths in it are relative to the file; SI units; unknown keys are refused. `brachis schema` prints a
JSON schema that editors use for completion: put `# yaml-language-server: $schema=task.schema.json` at the top of a task
file, with the schema saved beside it by `brachis schema --out task.schema.json`.

Limits: an absent key takes the URDF's limit, `null` removes it, a number holds for all joints, a list is in the order
of the chain, a mapping names joints (others keep the URDF's).
"""


def rows(model: type[BaseModel]) -> Iterator[str]:
    """Yield one line a key: name, default, description."""
    yield "| key | default | meaning |"
    yield "|---|---|---|"
    for name, field in model.model_fields.items():
        yield f"| `{name}` | {_default(field)} | {(field.description or '').replace('|', ' or ')} |"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or isinstance(value, BaseModel):
        return "see below"
    return "`null`" if value is None else f"`{list(value) if isinstance(value, tuple) else value}`"


def page() -> str:
    """Return the whole page."""
    parts = [INTRODUCTION, "## The file\n", *rows(Task)]
    for key, model in PARTS.items():
        parts += [f"\n## `{key}`\n", *rows(model)]
    parts += [
        "\n## `path`\n",
        "A list of segments, each a mapping with one of the keys below.\n",
        "| key | default | meaning |",
        "|---|---|---|",
    ]
    blend = SegmentModel.model_fields["blend"]
    parts.append(f"| `blend` | `null` | {blend.description} |")
    for kind, shapes in SEGMENTS.items():
        for shape in shapes:
            keys = ", ".join(f"{name}: ..." for name, field in shape.model_fields.items() if field.is_required())
            parts += [f"\n### `{kind}: {{{keys}}}`\n", *rows(shape)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
