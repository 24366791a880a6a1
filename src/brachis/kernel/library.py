"""Loading the compiled library and calling its functions."""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from brachis.errors import NotBuiltError
from brachis.kernel.compile import (
    SCRIPT,
    describe_file,
    library_path,
    source_digest,
)

_KINDS = {
    "p": ctypes.c_void_p,
    "l": ctypes.c_long,
    "d": ctypes.c_double,
    "i": ctypes.c_int,
    "-": None,
}
FUNCTIONS = {
    "brachis_torques": "- p K [Kn] [Kn] [Kn] >[Kn]",
    "brachis_torque_derivatives": "- p K [Kn] [Kn] [Kn] >[Knn] >[Knn] >[Knn]",
    "brachis_mass_matrices": "- p K [Kn] >[Knn]",
    "brachis_tool": "- p K [Kn] i >[K3] >[K33] >[6Kn]",
    "brachis_tool_derivatives": "- K n [6Kn] [Kn] [Kn] i >[36Kn]",
    "brachis_tool_sizes": "- p K i [Kn] [Kn] [Kn] p >[K]",
    "brachis_logarithms": "- K [K33] >[K3]",
    "brachis_bounds_of_pairs": "- P c [Pc] [Pc] [Pc] d >[P] >[P]",
    "brachis_go_backwards": "i {P c [Sc] [Sc] [Sc]} [S] [S] d d d >[P] >[P]",
    "brachis_go_forwards": "- P c [Sc] [Sc] [P] [P] d >[P]",
    "brachis_rotations": "- m K [mK4] >[mK33]",
    "brachis_body_twists": "- m K [mKw] >[rK6]",
    "brachis_newton": "- {p p K z [Kz] [Kn] r p l n [Kr] l} >[Kn]",
    "brachis_halve": "l {M n [M] [Mn] [M] [S] [S] l} l d d l B >[B]",
    "brachis_postures": "- p",
    "brachis_evaluate": "i p",
    "brachis_path_derivatives": "- p",
    "brachis_least_singular": "- K n [Knn] >[K] >[Kn]",
    "brachis_singular_slopes": "- p [K] [Kn] >[Kn] >[K]",
    "brachis_entries": "- K v c [oKvc] p >[ev]",
    "brachis_differentiate": "- {l l l l l l} p p p p p p p",
    "brachis_values": "- l l p l p p",
    "brachis_largest_products": "- E c n [Kcn] l[E] [En] >[E]",
    "brachis_solve_band": "- l l l p p",
    "brachis_blossoms": "- K g c [k] [Lc] l[K] [gK] >[Kc]",
    "brachis_spline_orders": "- o K {g L c [k] [Lc]} [K] d >[oKc]",
    "brachis_bernstein": "- K w L n [wLn] l[K] [K] >[Kn]",
    "brachis_curves": "- p l l p p",
    "brachis_formula": "- p l p l p l p",
}
"""Return type and arguments of each function: pointer, long, double, int, or nothing.

The shape of an array is in brackets: a letter stands for a size, a digit for a number. The function writes to arrays
after ``>``. Arrays after ``l`` contain whole numbers, all other arrays doubles. A letter by itself is that size.
Arguments in braces are fields of a structure, and the function gets its address. An ``i`` cannot be a field.
"""
_DOUBLE = np.dtype(np.float64)
WHOLE = np.dtype("l")
"""Type of whole numbers in the library."""


def _split(word: str) -> tuple[str, str]:
    """Split the declaration of an argument into its kind and the letters of its shape."""
    kind, _, letters = word.strip("{]}").partition("[")
    return kind, letters


_ARGUMENTS = {
    name: [_split(word) for word in words.split()[1:]]
    for name, words in FUNCTIONS.items()
}
_DIGITS = {str(digit): digit for digit in range(10)}


def _lay_out_structure(name: str) -> tuple[slice, struct.Struct]:
    """Return the slice of a function's arguments that are fields of a structure, and the layout of the structure."""
    before, _, braced = FUNCTIONS[name].partition("{")
    begin = len(before.split()) - 1
    fields = slice(begin, begin + len(braced.partition("}")[0].split()))
    layout = ""
    for kind, letters in _ARGUMENTS[name][fields]:
        layout += "P" if letters or kind == "p" else "d" if kind == "d" else "l"
    return fields, struct.Struct(layout)


_STRUCTURES = {
    name: _lay_out_structure(name) for name in FUNCTIONS if "{" in FUNCTIONS[name]
}


def declare_fields(declaration: str) -> list[tuple[str, Any]]:
    """List the fields of a C structure, declared as ``"l count; p q qdot"``, with types as in `FUNCTIONS`."""
    fields = []
    for line in declaration.split(";"):
        kind, *names = line.split()
        fields += [(name, _KINDS[kind]) for name in names]
    return fields


_find_address = ctypes.addressof
_find_buffer: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer


@cache
def load() -> ctypes.CDLL:
    """Load the library for this processor.

    Raises
    ------
    NotBuiltError
        The library was not compiled, is damaged, or was compiled from other source code.
    """
    baseline = _open(library_path("baseline"))
    faster = library_path("avx2")
    if baseline.brachis_has_avx2() and faster.exists():
        return _open(faster)
    return baseline


def _open(path: Path) -> ctypes.CDLL:
    try:
        size = describe_file(path)
        built_size = path.with_suffix(".sha256").read_text(encoding="ascii")
        if size != built_size:
            problem = f"{path.name} is damaged: it has {size} instead of {built_size}"
            raise NotBuiltError(problem, SCRIPT)
        library = ctypes.CDLL(str(path))
    except OSError as error:  # the file is missing, or for another kind of machine
        raise NotBuiltError(str(error), SCRIPT) from error
    library.brachis_source.restype = ctypes.c_char_p
    if library.brachis_source().decode() != source_digest():
        raise NotBuiltError(f"{path.name} was compiled from other source code", SCRIPT)
    for name, declaration in FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = _KINDS[declaration[0]]
        types = [
            _KINDS["p"] if letters else _KINDS.get(kind, ctypes.c_long)
            for kind, letters in _ARGUMENTS[name]
        ]
        if name in _STRUCTURES:
            fields, _ = _STRUCTURES[name]
            types[fields] = [_KINDS["p"]]
        function.argtypes = types
    return library


def address(values: np.ndarray) -> int:
    """Return the address of a contiguous array."""
    try:
        return _find_address(_find_buffer(values))
    except (TypeError, ValueError):  # the array is read-only or empty
        place, _ = values.__array_interface__["data"]
        return int(place)


def call(name: str, *arguments: Any) -> Any:
    """Call a function of the library. Contiguous arrays and structures are passed by address."""
    plain = [
        address(value) if isinstance(value, np.ndarray) else value
        for value in arguments
    ]
    if name in _STRUCTURES:
        fields, layout = _STRUCTURES[name]
        plain[fields] = [layout.pack(*plain[fields])]
    return getattr(load(), name)(*plain)


def call_checked(name: str, *arguments: Any, **sizes: int) -> Any:
    """Call a function of the library after checking the shapes of its arrays, and allocate its outputs.

    Parameters
    ----------
    name : str
        Name in `FUNCTIONS`.
    *arguments
        Arguments of the function, without sizes and without the arrays that the function writes.
    **sizes : int
        Sizes, named by their letters. Sizes that follow from the shapes of arrays may be omitted.

    Returns
    -------
    The return value of the function, then the arrays that the function writes; a list if there is more than one result.

    Raises
    ------
    ValueError, TypeError
        See `as_contiguous`.
    """
    shapes = tuple([getattr(value, "shape", None) for value in arguments])
    call_shapes = _resolve_shapes(name, shapes, tuple(sizes.items()))
    pairs = zip(arguments, call_shapes.taken, strict=True)
    taken = iter(
        [as_contiguous(value, *form) if form else value for value, form in pairs]
    )
    written = [np.empty(shape) for shape in call_shapes.written]
    values = [next(taken) if size is None else size for size in call_shapes.sizes]
    returned = call(name, *values, *written)
    results = written if FUNCTIONS[name][0] == "-" else [returned, *written]
    return results[0] if len(results) == 1 else results


class _CallShapes(NamedTuple):
    """Shapes and sizes of the arguments in one call.

    Attributes
    ----------
    taken : list
        Shape and type of each argument that is passed; empty if no shape is declared.
    sizes : list of int or None
        For each argument that is not an output, its size, or None if the caller passes the argument.
    written : list of tuple of int
        Shapes of the arrays that the function writes.
    """

    taken: list[tuple[Any, ...]]
    sizes: list[int | None]
    written: list[tuple[int, ...]]


@lru_cache(maxsize=4096)
def _resolve_shapes(
    name: str,
    shapes: tuple[tuple[int, ...] | None, ...],
    sizes: tuple[tuple[str, int], ...],
) -> _CallShapes:
    """Derive a function's sizes and the shapes of its outputs from the shapes of its arguments."""
    known = _DIGITS | dict(sizes)
    words = _ARGUMENTS[name]
    inputs = [word for word in words if word[0] in ("", *_KINDS)]
    taken: list[tuple[Any, ...]] = []
    for (kind, letters), shape in zip(inputs, shapes, strict=True):
        for letter, size in zip(letters, shape or (), strict=False):
            known.setdefault(letter, size)
        needed = tuple([known.get(letter, -1) for letter in letters])
        taken.append((needed, WHOLE if kind == "l" else _DOUBLE) if letters else ())
    return _CallShapes(
        taken,
        [
            None if word in inputs else known[word[0]]
            for word in words
            if word[0] != ">"
        ],
        [shape_of(letters, known) for kind, letters in words if kind == ">"],
    )


def shape_of(letters: str, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """Return the shape that letters and digits stand for."""
    return tuple(
        sizes[letter] if letter in sizes else int(letter) for letter in letters
    )


class Structured:
    """A dataclass that the library reads through a structure. It is built once and lives as long as the object."""

    __dataclass_fields__: dict[str, Any]

    def _make_structure(self) -> ctypes.Structure:
        """Build the structure. Arrays to which the structure points are stored as attributes of the structure."""
        raise NotImplementedError

    @property
    def structure(self) -> Any:
        """The structure that the library reads."""
        attributes = vars(self)
        if "_structure" not in attributes:
            # Threads that ask for the structure at the same time get the same one.
            attributes.setdefault("_structure", self._make_structure())
        return attributes["_structure"]

    @property
    def address(self) -> int:
        """Address of the structure."""
        return _find_address(self.structure)

    def __getstate__(self) -> dict[str, object]:
        """Return the fields only, without addresses and derived values."""
        return {name: vars(self)[name] for name in self.__dataclass_fields__}


def as_contiguous(
    values: Any, shape: tuple[int, ...], dtype: np.dtype[Any] = _DOUBLE
) -> np.ndarray:
    """Return an array, which must have the given shape, as contiguous numbers, by default doubles.

    Raises
    ------
    ValueError
        The array has a different shape, so the library would read beyond its end.
    TypeError
        The array is complex.
    """
    if type(values) is np.ndarray and values.dtype is dtype:
        if values.shape == shape and values.flags.c_contiguous:
            return values
    elif np.iscomplexobj(values):
        raise TypeError("an array is complex; needed: real numbers")
    array = np.ascontiguousarray(values, dtype=dtype)
    if array.shape != shape:
        raise ValueError(f"an array has the shape {array.shape}; needed: {shape}")
    return array


def as_doubles_at_points(
    values: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, int]:
    """Return numbers at K points, (K, ...), as contiguous doubles, and the offset from one point to the next.

    If all points share the same numbers, only those of one point are returned, and the offset is 0. In this case
    `values` may also be given for one point only. Raises the same errors as `as_contiguous`.
    """
    if values.ndim == len(shape) - 1:
        return as_contiguous(values, shape[1:]), 0
    if values.strides[0] == 0 and values.shape == shape and shape[0]:
        return as_contiguous(values[0], shape[1:]), 0
    return as_contiguous(values, shape), math.prod(shape[1:])
