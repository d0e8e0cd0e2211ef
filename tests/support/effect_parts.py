"""What several tests need of what effects and protocols of the simulated control share."""

from __future__ import annotations

from sim_controller.effects import names, unit
from sim_controller.protocols._tape import Tape

__all__ = [
    "Tape",
    "names",
    "unit",
]
