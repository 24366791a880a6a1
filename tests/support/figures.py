"""What figures show."""

from __future__ import annotations

from typing import Any


def lines_by_label(ax: Any) -> dict[str, Any]:
    """Return the curves that have labels."""
    curves = ((line.get_label(), line) for line in ax.get_lines())
    return {label: line for label, line in curves if not label.startswith("_")}
