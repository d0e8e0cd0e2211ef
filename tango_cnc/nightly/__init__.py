"""A night: measured while nobody needs the machine, decided once, kept, and told. docs/nightly.md."""

from .night import EXIT, day_of, night, stamp_of
from .ports import Delivery, Measured, Ports, PreflightPoint

__all__ = ["EXIT", "Delivery", "Measured", "Ports", "PreflightPoint", "day_of", "night", "stamp_of"]
