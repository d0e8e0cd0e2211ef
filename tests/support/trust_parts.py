"""What several tests of plausibility need of the command: whether readings are usable, how they are judged, in which words."""

from __future__ import annotations

from tango_cnc.commands._trust import members, status, told, usable
from tango_cnc.judging import judged, run_of, suspected

__all__ = ["judged", "members", "run_of", "status", "suspected", "told", "usable"]
