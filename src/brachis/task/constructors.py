"""Functions that make segments in programs; ``+`` joins segments to a path.

`Line`, `Arc`, `Circle`, `Helix` and `Spline` are generated from the models in `brachis.task.segments`. Their keywords
are the keys of a segment.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from brachis.common.arguments import check_keywords
from brachis.task.fields import describe_fields, required_keys
from brachis.task.messages import models_in, validate
from brachis.task.segments import (
    ArcSegment,
    CircleSegment,
    HelixSegment,
    LineSegment,
    SegmentModel,
    SplineSegment,
)

_S = TypeVar("_S", bound=SegmentModel)


def _constructor(model: type[_S], example: str) -> Callable[..., _S]:
    """Return the function that makes one kind of segment in programs; `example` goes into its docstring.

    The keywords of the function are the keys of the kind and of the segment itself. If the kind has a single form, its
    first key can be positional.
    """
    (kind,) = required_keys(model)
    name = kind.capitalize()
    shapes: list[Any] = [*models_in(model.model_fields[kind].annotation)]
    fields = {
        key: describe_fields(owner).get(key, "")
        for owner in (*shapes, model)
        for key in owner.model_fields
        if key != kind
    }
    needed = required_keys(shapes[0]) if len(shapes) == 1 else ()
    parameters = [
        inspect.Parameter(
            key,
            inspect.Parameter.POSITIONAL_OR_KEYWORD
            if key in needed[:1]
            else inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if key in needed else None,
        )
        for key in fields
    ]
    signature = inspect.Signature(parameters)

    def make(*args: Any, **keys: Any) -> _S:
        """Make the segment from positional and keyword arguments."""
        bound = signature.bind(*args, **keys).arguments
        shape_keys = {key: value for key, value in bound.items() if value is not None}
        beside = {
            key: shape_keys.pop(key) for key in model.model_fields if key in shape_keys
        }
        return validate(model, {kind: shape_keys, **beside}, name)

    described = [
        f"{key} : {'required' if key in needed else 'optional'}\n    {description}"
        for key, description in fields.items()
    ]
    make.__doc__ = _DOCSTRING.format(
        summary=model.__doc__, parameters="\n".join(described), example=example
    )
    make.__name__ = make.__qualname__ = name
    make.__signature__ = signature  # type: ignore[attr-defined]
    return check_keywords(make)


_DOCSTRING = """{summary}

Arrays are accepted as lists. The end of a line may be a transform such as Pinocchio's SE3. The waypoints of a spline
may be a sequence of transforms or of (4, 4) matrices, and their orientations a SciPy Rotation or (n, 3, 3) matrices.

Parameters
----------
{parameters}

Raises
------
TaskError
    A value is wrong, or not exactly one of the forms is given.

Examples
--------
>>> import brachis
{example}
"""
Line = _constructor(
    LineSegment,
    """\
>>> path = brachis.Line(by=[0.1, 0.0], blend=0.02) + brachis.Line(by=[0.0, 0.2])
>>> [segment.kind for segment in path]
['line', 'line']""",
)
Arc = _constructor(
    ArcSegment,
    """\
>>> brachis.Arc(center=[0.5, 0.0], angle_deg=90)
Arc(center=[0.5, 0], angle_deg=90)""",
)
Circle = _constructor(
    CircleSegment,
    """\
>>> brachis.Circle([0.5, 0.0], turns=2)
Circle(center=[0.5, 0], turns=2)""",
)
Helix = _constructor(
    HelixSegment,
    """\
>>> brachis.Helix([0.5, 0.0, 0.3], pitch=0.02, turns=3)
Helix(center=[0.5, 0, 0.3], turns=3, pitch=0.02)""",
)
Spline = _constructor(
    SplineSegment,
    """\
>>> import numpy as np
>>> x = np.linspace(0.1, 0.5, 500)
>>> wave = brachis.Spline(through=np.column_stack([x, np.sin(x)]), relative=True)
>>> len(wave.spline.through)
500""",
)
