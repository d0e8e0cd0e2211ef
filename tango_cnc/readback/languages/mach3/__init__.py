"""Mach3 programs read back, with the Basic of the macros that make their moves."""

from .program import LANGUAGE

__all__ = ["LANGUAGE"]
