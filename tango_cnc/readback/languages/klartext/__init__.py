"""HEIDENHAIN Klartext read back: blocks, texts of FN 16, and the probing cycle 444."""

from .program import LANGUAGE

__all__ = ["LANGUAGE"]
