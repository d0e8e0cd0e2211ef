"""Figures, limits, conditions and certificates → one page that a person signs."""

from .sheet import Order, Row, Signed, made, read_order

__all__ = ["Order", "Row", "Signed", "made", "read_order"]
