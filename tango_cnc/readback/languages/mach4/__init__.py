"""Mach4 programs read back, with the Lua of the scripts behind their M codes."""

from .program import LANGUAGE

__all__ = ["LANGUAGE"]
