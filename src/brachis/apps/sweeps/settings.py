"""What a sweep file says: a task, and the values that its keys take."""

from __future__ import annotations

import itertools
import json
import math
import zlib
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    JsonValue,
    field_validator,
    model_validator,
)

from brachis.errors import TaskError
from brachis.task.fields import (
    ByForm,
    ByKey,
    Count,
    Model,
    Name,
    Number,
    Positive,
    refuse,
)

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


class Linear(Model):
    """Values at equal distances."""

    linear: tuple[Number, Number, _HowMany] = Field(
        description="First value, last value, how many."
    )

    def values(self) -> list[JsonValue]:
        """List them."""
        return np.linspace(*self.linear).tolist()


class Logarithmic(Model):
    """Values at equal ratios."""

    logarithmic: tuple[Positive, Positive, _HowMany] = Field(
        description="First value, last value, how many."
    )

    def values(self) -> list[JsonValue]:
        """List them."""
        return np.geomspace(*self.logarithmic).tolist()


GridValues = Annotated[
    _Values | Annotated[Linear | Logarithmic, ByKey("values are spaced in one way")],
    ByForm(
        "a list of values, {linear: [first, last, count]} or {logarithmic: [first, last, count]}"
    ),
]


class Uniform(Model):
    """Every value of a range is as likely."""

    uniform: Annotated[tuple[Number, Number], AfterValidator(_ascending)] = Field(
        description="Both ends."
    )

    def draw(self, generator: np.random.Generator, count: int) -> list[Any]:
        """Draw values."""
        return generator.uniform(*self.uniform, size=count).tolist()


class LogUniform(Model):
    """Every ratio within a range is as likely."""

    log_uniform: Annotated[tuple[Positive, Positive], AfterValidator(_ascending)] = (
        Field(description="Both ends, > 0.")
    )

    def draw(self, generator: np.random.Generator, count: int) -> list[Any]:
        """Draw values."""
        low, high = map(math.log, self.log_uniform)
        return np.exp(generator.uniform(low, high, size=count)).tolist()


class Normal(Model):
    """A normal distribution."""

    normal: tuple[Number, Positive] = Field(description="Mean and standard deviation.")

    def draw(self, generator: np.random.Generator, count: int) -> list[Any]:
        """Draw values."""
        return generator.normal(*self.normal, size=count).tolist()


class Choice(Model):
    """One of a list, each as likely."""

    choice: _Values = Field(description="The values.")

    def draw(self, generator: np.random.Generator, count: int) -> list[Any]:
        """Draw values."""
        return [
            self.choice[place]
            for place in generator.integers(len(self.choice), size=count)
        ]


Distribution = Annotated[
    Uniform | LogUniform | Normal | Choice,
    ByKey("a distribution has one of these keys"),
]


class RandomSettings(Model):
    """Keys with random values."""

    count: _HowMany = Field(description="Number of draws.")
    seed: Count = Field(
        default=0,
        ge=0,
        description="Seed. Every key has a stream of its own: more draws, or another key, leave the first ones as they "
        "are.",
    )
    keys: Annotated[dict[Name, Distribution], Field(min_length=1)] = Field(
        description="For every key uniform: [low, high], log_uniform: [low, high], normal: [mean, standard deviation] "
        "or choice: [values]."
    )

    def draws(self) -> list[dict[str, JsonValue]]:
        """Draw: for each of the draws the values of all keys."""
        columns = {
            key: distribution.draw(
                np.random.default_rng([self.seed, zlib.crc32(key.encode())]), self.count
            )
            for key, distribution in self.keys.items()
        }
        return [
            dict(zip(columns, values, strict=True))
            for values in zip(*columns.values(), strict=True)
        ]


class SweepSettings(Model):
    """A sweep: every combination of the grid, with every row, with every random draw."""

    sweep: Literal[1] = Field(description="Version of the format.")
    task: JsonValue = Field(
        description="Task file, relative to the sweep file's folder; or a task in place."
    )
    fixed: dict[Name, JsonValue] = Field(
        default={}, description="Keys that all plans set alike."
    )
    grid: dict[Name, GridValues] = Field(
        default={},
        description="For every key its values: a list, {linear: [first, last, count]} or {logarithmic: [first, last, "
        "count]}.",
    )
    rows: tuple[dict[Name, JsonValue], ...] = Field(
        default=(), description="Keys that change together."
    )
    random: RandomSettings | None = Field(
        default=None, description="Keys with random values."
    )

    @field_validator("task")
    @classmethod
    def _task_is_named_or_given(cls, task: JsonValue) -> JsonValue:
        if not isinstance(task, str | dict) or not task:
            raise refuse(
                "no task", found=task, allowed="the name of a task file, or a task"
            )
        return task

    @model_validator(mode="after")
    def _every_key_in_one_place(self) -> SweepSettings:
        drawn = self.random.keys if self.random else {}
        rows = {key for row in self.rows for key in row}
        places = {
            "fixed": set(self.fixed),
            "grid": set(self.grid),
            "rows": rows,
            "random": set(drawn),
        }
        found: dict[str, str] = {}
        for place, keys in places.items():
            for key in keys:
                if key in found:
                    raise refuse(
                        f"{key} is varied twice",
                        key=place,
                        found=f"in {found[key]} and in {place}",
                        allowed="once",
                    )
                found[key] = place
        return self

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that are varied, in the order of the file."""
        in_rows = dict.fromkeys(key for row in self.rows for key in row)
        return (*self.grid, *in_rows, *(self.random.keys if self.random else ()))

    def changes(self) -> list[dict[str, JsonValue]]:
        """List what every plan sets of the varied keys: the grid's first key changes slowest, equal ones come once.

        Raises
        ------
        TaskError
            There are more than `MOST_PLANS`.
        """
        columns = [
            list(values) if isinstance(values, tuple) else values.values()
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
        parts = (grid, self.rows or ({},), self.random.draws() if self.random else [{}])
        changes = [
            {**cell, **row, **draw} for cell, row, draw in itertools.product(*parts)
        ]
        return list({_alike(each): each for each in reversed(changes)}.values())[::-1]


def _alike(changes: dict[str, JsonValue]) -> str:
    """Return a text that is the same for the same changes, whether a number is written as 90 or as 90.0."""
    return json.dumps(json.loads(json.dumps(changes), parse_int=float), sort_keys=True)
