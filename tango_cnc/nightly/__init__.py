"""A night: measured while nobody needs the machine, decided once, kept, and told. docs/nightly.md."""

from ..history.records import stamp_of
from .night import EXIT, day_of, exit_of, night
from .ports import Delivery, Measured, Ports, PreflightPoint

__all__ = ["EXIT", "Delivery", "Measured", "Ports", "PreflightPoint", "day_of", "exit_of", "night", "stamp_of"]
