"""Robots of the package example-robot-data, where that is installed."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import pytest

FOLDER = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data"


def published_urdf(name: str) -> Path:
    """The file of a robot below the folder ``robots``."""
    path = FOLDER / "robots" / name
    if not path.is_file():
        pytest.skip("example-robot-data is not installed")
    return path
