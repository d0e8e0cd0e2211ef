"""A night: measured while nobody needs the machine, decided once, kept, and told. docs/nightly.md."""

from .night import EXIT, day_of, night, stamp_of
from .ports import Delivery, Finding, Measured, Ports

__all__ = ["EXIT", "Delivery", "Finding", "Measured", "Ports", "day_of", "night", "stamp_of"]
