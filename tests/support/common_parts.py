"""What several tests need of what commands share: the dialect of a cell, tables of a terminal, settings that ask for a finger."""

from __future__ import annotations

from tango_cnc.commands._common import asks_for_a_finger, dialect, table, wide

__all__ = ["asks_for_a_finger", "dialect", "table", "wide"]
