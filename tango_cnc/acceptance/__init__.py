"""Figures, limits, conditions and certificates → one page that a person signs."""

from .order import RELATIVE, Certificate, Order, PartAsked, read_order
from .sheet import Row, Signed, Source, made

__all__ = ["RELATIVE", "Certificate", "Order", "PartAsked", "Row", "Signed", "Source", "made", "read_order"]
