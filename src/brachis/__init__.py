"""Minimum-time motion of redundant robots along prescribed paths."""
