"""The solver backends of this environment: ipyopt has wheels for Linux on x86_64 alone."""

from __future__ import annotations

from importlib.util import find_spec

from brachis.optimise.backends import SOLVERS

INSTALLED = tuple(name for name in SOLVERS if name != "ipopt" or find_spec("ipyopt"))
