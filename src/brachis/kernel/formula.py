"""Formulas written with NumPy. They are recorded once, and the library evaluates them at many points.

To record a function, it is called once with arrays of `Number` in place of values. For square roots and angles, the
function must use the functions of this module. With plain values, these are NumPy's functions. The operations are
recorded as a sequence of steps. The derivatives are recorded too, by the chain rule from the last step to the first
(reverse accumulation; A. Griewank, A. Walther, Evaluating Derivatives, 2008). Steps that are not needed are left out,
and equal steps are stored once.

A function must perform the same operations for all values, so it may use neither comparisons nor `numpy.linalg`. Terms
with a factor of zero count as zero, even if the other factor is infinite.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from brachis.kernel.library import (
    Structured,
    address,
    as_contiguous,
    call,
    declare_fields,
)

_OPERATIONS = "add subtract multiply divide negate sqrt sin cos arccos arctan2 ceil"
_CODES = {name: code for code, name in enumerate(_OPERATIONS.split())}
"""Codes of the operations, in the order of formula.c."""


def _make_operator(
    apply: Callable[[Record, Number, Number], Number],
) -> Callable[[Number, Any], Number]:
    """Return a method that applies an operation to a number and a second operand, which may be a plain number."""

    def operate(self: Number, operand: Any) -> Number:
        return apply(self.record, self, self.record.number(operand))

    return operate


class Number:
    """A number of a formula: an input, a constant, or the result of an operation.

    Attributes
    ----------
    record : Record
        Record to which the number belongs.
    operation : str
        The name of an operation, ``input`` or ``constant``.
    operands : tuple
        Operands of the operation. For an input, this is its index; for a constant, its value.
    place : int
        Position among the numbers of the record.
    value : float or None
        Value if the number is a constant, otherwise None.
    """

    __slots__ = ("operands", "operation", "place", "record", "value")

    def __init__(
        self, record: Record, operation: str, operands: tuple[Any, ...]
    ) -> None:
        self.record = record
        self.operation = operation
        self.operands = operands
        self.place = len(record.numbers)
        self.value: float | None = operands[0] if operation == "constant" else None

    __add__ = __radd__ = _make_operator(lambda record, a, b: record.add(a, b))
    __mul__ = __rmul__ = _make_operator(lambda record, a, b: record.multiply(a, b))
    __sub__ = _make_operator(lambda record, a, b: record.add(a, -b))
    __rsub__ = _make_operator(lambda record, a, b: record.add(b, -a))
    __truediv__ = _make_operator(lambda record, a, b: record.divide(a, b))
    __rtruediv__ = _make_operator(lambda record, a, b: record.divide(b, a))

    def __neg__(self) -> Number:
        """Change the sign."""
        return self.record.negate(self)


@dataclass(frozen=True, eq=False)
class Record:
    """The numbers of a formula, in the order in which they were created."""

    numbers: list[Number] = field(default_factory=list)
    _known: dict[tuple[Any, ...], Number] = field(default_factory=dict)

    def _add_number(self, operation: str, *operands: Any) -> Number:
        """Return the number for an operation; create the number if it is new."""
        key = (operation, *operands)  # numbers are compared by identity
        known = self._known.get(key)
        if known is None:
            known = Number(self, operation, operands)
            self.numbers.append(known)
            self._known[key] = known
        return known

    def inputs(self, count: int) -> np.ndarray:
        """Create the next inputs of the formula, (1, count)."""
        begin = sum(number.operation == "input" for number in self.numbers)
        made = [self._add_number("input", begin + i) for i in range(count)]
        return np.array(made, dtype=object).reshape(1, count)

    def number(self, value: Any) -> Number:
        """Return a `Number` unchanged, and any other value as a constant."""
        return (
            value
            if isinstance(value, Number)
            else self._add_number("constant", float(value))
        )

    def apply(self, function: str, *operands: Number) -> Number:
        """Apply a function of one or two numbers."""
        values = [operand.value for operand in operands]
        if None in values:
            return self._add_number(function, *operands)
        return self.number(getattr(np, function)(*values))

    def add(self, a: Number, b: Number) -> Number:
        """Add two numbers. If one of them is a negated number, record a subtraction."""
        if a.value is not None and b.value is not None:
            return self.number(a.value + b.value)
        if a.value == 0.0:
            return b
        if b.value == 0.0:
            return a
        if b.operation == "negate":
            return self._add_number("subtract", a, b.operands[0])
        if a.operation == "negate":
            return self._add_number("subtract", b, a.operands[0])
        return self._add_number("add", *sorted((a, b), key=_place))

    def negate(self, a: Number) -> Number:
        """Change the sign of a number."""
        if a.value is not None:
            return self.number(-a.value)
        return (
            a.operands[0] if a.operation == "negate" else self._add_number("negate", a)
        )

    def multiply(self, a: Number, b: Number) -> Number:
        """Multiply two numbers."""
        if b.value is not None:
            a, b = (b, a)
        if a.value is not None and b.value is not None:
            return self.number(a.value * b.value)
        if a.value == 0.0:
            return a
        if a.value in (1.0, -1.0):
            return b if a.value == 1.0 else -b
        if a.operation == "negate":
            return -self.multiply(a.operands[0], b)
        if b.operation == "negate":
            return -self.multiply(a, b.operands[0])
        return self._add_number("multiply", *sorted((a, b), key=_place))

    def divide(self, a: Number, b: Number) -> Number:
        """Divide one number by another."""
        if a.value == 0.0 or b.value == 1.0:
            return a
        if a.value is not None and b.value:
            return self.number(a.value / b.value)
        return self._add_number("divide", a, b)

    def gradient(self, output: Number, inputs: np.ndarray) -> list[Number]:
        """Differentiate a number with respect to inputs."""
        slopes = {output: self.number(1.0)}
        for number in self.numbers[output.place :: -1]:
            slope = slopes.get(number)
            if slope is None or number.operation in ("input", "constant"):
                continue
            partials = _SLOPES[number.operation](number, *number.operands)
            for operand, by_operand in zip(number.operands, partials, strict=True):
                term = slope * by_operand
                slopes[operand] = slopes[operand] + term if operand in slopes else term
        zero = self.number(0.0)
        return [slopes.get(number, zero) for number in inputs.ravel()]


_SLOPES: dict[str, Callable[..., tuple[Any, ...]]] = {
    "add": lambda _, _a, _b: (1.0, 1.0),
    "subtract": lambda _, _a, _b: (1.0, -1.0),
    "multiply": lambda _, a, b: (b, a),
    "divide": lambda c, _, b: (1.0 / b, -c / b),
    "negate": lambda _, _a: (-1.0,),
    "sqrt": lambda c, _: (0.5 / c,),
    "sin": lambda _, a: (cos(a),),
    "cos": lambda _, a: (-sin(a),),
    "arccos": lambda _, a: (-1.0 / sqrt(1.0 - a * a),),
    "arctan2": lambda _, a, b: (b / (a * a + b * b), -a / (a * a + b * b)),
    "ceil": lambda _, _a: (0.0,),
}
"""Slopes of an operation's result with respect to its operands."""


def _place(number: Number) -> int:
    return number.place


def _make_recordable(function: np.ufunc) -> Callable[..., Any]:
    """Return a NumPy function that also accepts arrays of a formula's numbers, mixed with plain numbers."""

    def apply_to_one(*values: Any) -> Any:
        """Record the step if one of the values belongs to a formula; otherwise compute the result."""
        records = [value.record for value in values if isinstance(value, Number)]
        if not records:
            return function(*values)
        return records[0].apply(function.__name__, *map(records[0].number, values))

    def apply(*values: Any) -> Any:
        if all(np.asarray(value).dtype != object for value in values):
            return function(*values)
        return np.frompyfunc(apply_to_one, len(values), 1)(*values)

    return apply


sqrt: Callable[..., Any] = _make_recordable(np.sqrt)
sin: Callable[..., Any] = _make_recordable(np.sin)
cos: Callable[..., Any] = _make_recordable(np.cos)
arccos: Callable[..., Any] = _make_recordable(np.arccos)
arctan2: Callable[..., Any] = _make_recordable(np.arctan2)
ceil: Callable[..., Any] = _make_recordable(np.ceil)


class _Formula(ctypes.Structure):
    """The structure `formula` of motion.h."""

    _fields_ = declare_fields(
        "l first_count second_count constant_count; p constants; l step_count; p steps; "
        "l output_count; p outputs; l row_length"
    )


@dataclass(frozen=True, eq=False)
class Formula(Structured):
    """A recorded function of K points, with one or two arguments.

    Attributes
    ----------
    counts : tuple of int
        Number of inputs in each argument.
    shape : tuple of int
        Shape of the results at a point.
    constants : (c,) ndarray
    steps : (s, 3) int32 ndarray
        Operation and operands of each step. The operands are indices over inputs, constants and steps.
    outputs : (o,) int32 ndarray
        Indices of the results, over the same inputs, constants and steps.
    discards_incomplete : bool
        Whether a row along the last axis becomes NaN entirely if one of its numbers is not finite.
    """

    counts: tuple[int, ...]
    shape: tuple[int, ...]
    constants: np.ndarray
    steps: np.ndarray
    outputs: np.ndarray
    discards_incomplete: bool = False

    @classmethod
    def of(
        cls,
        function: Callable[..., np.ndarray],
        *counts: int,
        discards_incomplete: bool = False,
    ) -> Formula:
        """Record a function of arrays, (K, count) each, that returns an array, (K, ...)."""
        record = Record()
        with np.errstate(all="ignore"):
            results = function(*(record.inputs(count) for count in counts))[0]
        outputs = [record.number(result) for result in results.flat]
        numbers = record.numbers
        constants = [number for number in numbers if number.operation == "constant"]
        computed = [number for number in numbers if number.operation in _CODES]
        place = {
            number: number.operands[0]
            for number in numbers
            if number.operation == "input"
        }
        place |= {
            number: sum(counts) + i for i, number in enumerate((*constants, *computed))
        }
        steps = [
            (
                _CODES[number.operation],
                place[number.operands[0]],
                place[number.operands[-1]],
            )
            for number in computed
        ]
        formula = cls(
            counts,
            results.shape,
            np.array([number.value for number in constants], dtype=float),
            np.array(steps, dtype=np.int32).reshape(-1, 3),
            np.array([place[number] for number in outputs], dtype=np.int32),
            discards_incomplete,
        )
        return formula.select(...)

    @classmethod
    def gradient(
        cls, function: Callable[[np.ndarray], np.ndarray], count: int
    ) -> Formula:
        """Record the slopes, (K, c, count), of a function that returns an array, (K, c)."""

        def differentiate(inputs: np.ndarray) -> np.ndarray:
            """Return the slopes at one point, (1, c, count)."""
            record = inputs[0, 0].record
            values = [record.number(value) for value in function(inputs)[0]]
            slopes = [record.gradient(value, inputs) for value in values]
            return np.array(slopes, dtype=object).reshape(1, len(values), count)

        return cls.of(differentiate, count)

    def select(self, index: Any) -> Formula:
        """Return the formula for only some of the results at a point, selected by a NumPy index."""
        outputs = np.reshape(self.outputs, self.shape)[index]
        inputs = sum(self.counts)
        begin = inputs + len(self.constants)
        needed = np.zeros(begin + len(self.steps), dtype=bool)
        needed[outputs] = True
        needed[:inputs] = True
        operands = self.steps[:, 1:].tolist()
        for step in range(len(operands) - 1, -1, -1):
            if needed[begin + step]:
                needed[operands[step]] = True
        place = np.cumsum(needed, dtype=np.int32) - 1
        steps = self.steps[needed[begin:]]
        steps[:, 1:] = place[steps[:, 1:]]
        constants = self.constants[needed[inputs:begin]]
        return replace(
            self,
            shape=outputs.shape,
            constants=constants,
            steps=steps,
            outputs=place[outputs].ravel(),
        )

    def __call__(self, *points: np.ndarray) -> np.ndarray:
        """Evaluate the formula at K points. Each argument has the shape (K, count), the result (K, ...)."""
        count = len(points[0])
        pairs = zip(points, self.counts, strict=True)
        arrays = [as_contiguous(values, (count, size)) for values, size in pairs]
        results = np.empty((count, *self.shape))
        first = arrays[0]
        second = arrays[-1]
        sizes = self.counts
        call(
            "brachis_formula",
            self.address,
            count,
            first,
            sizes[0],
            second,
            sizes[-1],
            results,
        )
        return results

    def _make_structure(self) -> _Formula:
        counts = (*self.counts, 0)[:2]
        fields: list[int] = []
        for array in (self.constants, self.steps, self.outputs):
            fields += [len(array), address(array)]
        row_length = self.shape[-1] if self.discards_incomplete else 0
        return _Formula(*counts, *fields, row_length)
