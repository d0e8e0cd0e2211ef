"""Figures, limits, conditions and certificates → one page that a person signs."""

from .order import Certificate, Order, read_order
from .sheet import Row, Signed, Source, made

__all__ = ["Certificate", "Order", "Row", "Signed", "Source", "made", "read_order"]
