"""Composing robots: an arm on a linear axis, as a plain URDF."""

from brachis.compose.rail import Rail, on_rail

__all__ = ["Rail", "on_rail"]
