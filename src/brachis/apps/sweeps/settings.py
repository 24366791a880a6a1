"""Content of a sweep file: a task, and the values of its keys."""

from __future__ import annotations

import itertools
import json
import math
import zlib
from collections.abc import Collection
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    JsonValue,
    field_validator,
    model_validator,
)

from brachis.errors import TaskError
from brachis.task.fields import ByForm, Count, Model, Name, Number, Positive, refuse

MOST_PLANS = 1_000_000
_HowMany = Annotated[Count, Field(ge=1, le=MOST_PLANS)]
_Values = Annotated[tuple[JsonValue, ...], Field(min_length=1)]


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise refuse(
            "the first end must be below the second",
            found=list(pair),
            allowed="[low, high] with low < high",
        )
    return pair


class _OneKey(Model):
    """A mapping in which exactly one of the keys is given."""

    @property
    def given(self) -> dict[str, Any]:
        """The given key with its value."""
        return {key: value for key, value in self if value is not None}

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        keys = self.given
        if len(keys) != 1:
            raise refuse(
                "exactly one key is needed",
                found=", ".join(keys) or "none",
                allowed=", ".join(type(self).model_fields),
            )
        return self


class Spacing(_OneKey):
    """Values with equal distances or equal ratios between them."""

    linear: tuple[Number, Number, _HowMany] | None = Field(
        default=None,
        description="Values at equal distances: first value, last value, number of values.",
    )
    logarithmic: tuple[Positive, Positive, _HowMany] | None = Field(
        default=None,
        description="Values at equal ratios: first value, last value, number of values.",
    )

    def values(self) -> list[JsonValue]:
        """List the values."""
        ((key, values),) = self.given.items()
        spread = np.linspace if key == "linear" else np.geomspace
        return spread(*values).tolist()


GridValues = Annotated[
    _Values | Spacing,
    ByForm(
        "a list of values, {linear: [first, last, count]} or {logarithmic: [first, last, count]}"
    ),
]


class Distribution(_OneKey):
    """Distribution of random values."""

    uniform: Annotated[tuple[Number, Number], AfterValidator(_ascending)] | None = (
        Field(
            default=None, description="All values between two ends are equally likely."
        )
    )
    log_uniform: (
        Annotated[tuple[Positive, Positive], AfterValidator(_ascending)] | None
    ) = Field(
        default=None,
        description="The logarithm of the value is uniform between the logarithms of two ends > 0.",
    )
    normal: tuple[Number, Positive] | None = Field(
        default=None, description="Normal distribution: mean and standard deviation."
    )
    choice: _Values | None = Field(
        default=None, description="All listed values are equally likely."
    )

    def draw(self, generator: np.random.Generator, count: int) -> list[Any]:
        """Draw random values."""
        ((key, values),) = self.given.items()
        if key == "choice":
            return [values[i] for i in generator.integers(len(values), size=count)]
        first, second = values
        if key == "log_uniform":
            logarithms = generator.uniform(math.log(first), math.log(second), count)
            return np.exp(logarithms).tolist()
        draw = generator.normal if key == "normal" else generator.uniform
        return draw(first, second, count).tolist()


class RandomSettings(Model):
    """Keys with random values."""

    count: _HowMany = Field(description="Number of draws.")
    seed: Count = Field(
        default=0,
        ge=0,
        description="Seed of the random values. Every key has its own random stream, so that more draws or further "
        "keys do not change the first draws.",
    )
    keys: Annotated[dict[Name, Distribution], Field(min_length=1)] = Field(
        description="The distribution of every key: uniform: [low, high], log_uniform: [low, high], normal: [mean, "
        "standard deviation] or choice: [values]."
    )

    def draws(self) -> list[dict[str, JsonValue]]:
        """Return the values of all keys for each draw."""
        drawn: list[dict[str, JsonValue]] = [{} for _ in range(self.count)]
        for key, distribution in self.keys.items():
            seed = [self.seed, zlib.crc32(key.encode())]
            values = distribution.draw(np.random.default_rng(seed), self.count)
            for changes, value in zip(drawn, values, strict=True):
                changes[key] = value
        return drawn


class SweepSettings(Model):
    """A sweep, which combines every point of the grid with every row and every random draw."""

    sweep: Literal[1] = Field(description="Version of the format.")
    task: JsonValue = Field(
        description="Task file, relative to the folder of the sweep file; or the task itself."
    )
    fixed: dict[Name, JsonValue] = Field(
        default={}, description="Keys that have the same value in all plans."
    )
    grid: dict[Name, GridValues] = Field(
        default={},
        description="Values of every key: a list, {linear: [first, last, count]} or {logarithmic: [first, last, "
        "count]}.",
    )
    rows: tuple[dict[Name, JsonValue], ...] = Field(
        default=(), description="Sets of keys that change together."
    )
    random: RandomSettings | None = Field(
        default=None, description="Keys with random values."
    )

    @field_validator("task")
    @classmethod
    def _check_task(cls, task: JsonValue) -> JsonValue:
        if not isinstance(task, str | dict) or not task:
            raise refuse(
                "this is not a task",
                found=task,
                allowed="the name of a task file, or a task",
            )
        return task

    @model_validator(mode="after")
    def _check_places(self) -> SweepSettings:
        places = {"fixed": self.fixed, **self._varied}
        place_of: dict[str, str] = {}
        for place, keys in places.items():
            for key in keys:
                if key in place_of:
                    raise refuse(
                        f"{key} is varied twice",
                        key=place,
                        found=f"in {place_of[key]} and in {place}",
                        allowed="once",
                    )
                place_of[key] = place
        return self

    @property
    def _varied(self) -> dict[str, Collection[str]]:
        """Varied keys, by the part of the file that varies them."""
        return {
            "grid": self.grid,
            "rows": dict.fromkeys(key for row in self.rows for key in row),
            "random": self.random.keys if self.random else (),
        }

    @property
    def keys(self) -> tuple[str, ...]:
        """Varied keys, in the order of the file."""
        return tuple(itertools.chain(*self._varied.values()))

    def changes(self) -> list[dict[str, JsonValue]]:
        """List the varied keys and their values for every plan. The first key of the grid changes slowest.

        Equal plans are listed only once.

        Raises
        ------
        TaskError
            There are more than `MOST_PLANS` plans.
        """
        columns = [
            values.values() if isinstance(values, Spacing) else values
            for values in self.grid.values()
        ]
        draws = self.random.count if self.random else 1
        many = math.prod(map(len, columns)) * max(1, len(self.rows)) * draws
        if many > MOST_PLANS:
            raise TaskError(
                "too many plans",
                where="sweep",
                found=f"{many:.3g}",
                allowed=f"at most {MOST_PLANS}",
            )
        grid = [
            dict(zip(self.grid, values, strict=True))
            for values in itertools.product(*columns)
        ]
        varied = (
            grid,
            self.rows or ({},),
            self.random.draws() if self.random else [{}],
        )
        changes = [
            {**cell, **row, **draw} for cell, row, draw in itertools.product(*varied)
        ]
        return list({_alike(change): change for change in reversed(changes)}.values())[
            ::-1
        ]


def _alike(changes: dict[str, JsonValue]) -> str:
    """Return a text that is equal for equal changes, whether a number is written as 90 or 90.0."""
    return json.dumps(json.loads(json.dumps(changes), parse_int=float), sort_keys=True)
