"""Composing robots: an arm on a linear axis, as a plain URDF."""

from brachis.compose.rail import on_rail

__all__ = ["on_rail"]
