"""What several tests of plausibility need of the command: whether readings are usable, how they are judged, in which words."""

from __future__ import annotations

from tango_cnc.commands._trust import judged, members, run_of, status, suspected, told, usable

__all__ = ["judged", "members", "run_of", "status", "suspected", "told", "usable"]
