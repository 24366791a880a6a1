"""Load the compiled library, and call its functions."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

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
    "brachis_torques": "- plpppp",
    "brachis_torque_derivatives": "- plpppppp",
    "brachis_mass_matrices": "- plpp",
    "brachis_tool": "- plpippp",
    "brachis_tool_derivatives": "- llpppippp",
    "brachis_tool_sizes": "- plippppppp",
    "brachis_logarithms": "- lpp",
    "brachis_bounds_of_pairs": "- llpppdpp",
    "brachis_go_backwards": "i llpppppdddpp",
    "brachis_go_forwards": "- llppppp",
    "brachis_rotations": "- llpp",
    "brachis_body_twists": "- llpp",
    "brachis_newton": "- ppllpplpllplddip",
    "brachis_halve": "l plddlpp",
    "brachis_postures": "- p",
    "brachis_evaluate": "i plpp",
    "brachis_path_derivatives": "- p",
    "brachis_least_singular": "- llppp",
    "brachis_singular_slopes": "- ppppp",
    "brachis_entries": "- lllppp",
    "brachis_differentiate": "- lllpppplppllppp",
    "brachis_values": "- llplppp",
    "brachis_largest_parts": "- lllpppp",
    "brachis_solve_band": "- lllpp",
    "brachis_blossoms": "- lllpppppp",
    "brachis_curves": "- lllllpppp",
    "brachis_formula": "- plplplpp",
    "brachis_side_by_side": "l ",
}
"""What functions return and take: pointer, long, double, int, or nothing."""
_DOUBLE = np.dtype(np.float64)


def declare_fields(declaration: str) -> list[tuple[str, Any]]:
    """List the fields of a structure in C: ``"l count; p q qdot"``, with the letters of `FUNCTIONS` for the types."""
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
        It was not compiled, is damaged, or belongs to other source.
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
    except OSError as error:  # missing, or of another kind of machine
        raise NotBuiltError(str(error), SCRIPT) from error
    library.brachis_source.restype = ctypes.c_char_p
    found = library.brachis_source().decode()
    if found != source_digest():
        raise NotBuiltError(f"{path.name} was made of other source", SCRIPT)
    for name, kinds in FUNCTIONS.items():
        function = getattr(library, name)
        returned, _, taken = kinds.partition(" ")
        function.restype = _KINDS[returned]
        function.argtypes = [_KINDS[kind] for kind in taken]
    return library


def address(values: np.ndarray) -> int:
    """Return where the numbers of a contiguous array begin."""
    try:
        return _find_address(_find_buffer(values))
    except (TypeError, ValueError):  # read-only, or empty
        place, _ = values.__array_interface__["data"]
        return int(place)


def call(name: str, *arguments: Any) -> Any:
    """Call a function of the library; of contiguous arrays it gets the addresses."""
    plain = [
        address(value) if isinstance(value, np.ndarray) else value
        for value in arguments
    ]
    return getattr(load(), name)(*plain)


class Structured:
    """A dataclass that the library reads by a structure, which is made once and lives as long as the object."""

    __dataclass_fields__: dict[str, Any]

    def _make_structure(self) -> ctypes.Structure:
        """Make the structure; arrays that it points to are attributes of it."""
        raise NotImplementedError

    @property
    def structure(self) -> Any:
        """What the library reads."""
        kept = vars(self)
        if "_structure" not in kept:
            # Threads that ask together get the same one.
            kept.setdefault("_structure", self._make_structure())
        return kept["_structure"]

    @property
    def address(self) -> int:
        """Where the library finds the structure."""
        return _find_address(self.structure)

    def __getstate__(self) -> dict[str, object]:
        """Leave addresses, and what follows from the fields, behind."""
        return {name: vars(self)[name] for name in self.__dataclass_fields__}


def as_doubles(values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of this shape as contiguous doubles.

    Raises
    ------
    ValueError
        It has another shape: the library would read beyond its end.
    TypeError
        It is complex.
    """
    if type(values) is np.ndarray and values.dtype is _DOUBLE:
        if values.shape == shape and values.flags.c_contiguous:
            return values
    elif np.iscomplexobj(values):
        raise TypeError("an array is complex; needed: real numbers")
    found = np.ascontiguousarray(values, dtype=np.float64)
    if found.shape != shape:
        raise ValueError(f"an array has the shape {found.shape}; needed: {shape}")
    return found


def as_doubles_at_points(
    values: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, int]:
    """Return numbers at K points, (K, ...), as contiguous doubles, and how far it is from a point to the next one.

    Where they are the same at all points, they are those of one, and the distance is 0. `values` may then be those of
    one point too. Raises as `as_doubles` does.
    """
    if values.ndim == len(shape) - 1:
        return as_doubles(values, shape[1:]), 0
    if values.strides[0] == 0 and values.shape == shape and shape[0]:
        return as_doubles(values[0], shape[1:]), 0
    return as_doubles(values, shape), math.prod(shape[1:])
