"""What several tests of nights need of the command: nights of a simulated machine, those of a cell, the world around one."""

from __future__ import annotations

from tango_cnc.commands import _simulated_nights as simulated
from tango_cnc.commands._again import again, files_of
from tango_cnc.commands._cell_nights import as_of, nights_of, twin
from tango_cnc.commands._cut_off import (
    JOURNAL,
    KEPT,
    PLANNED,
    executed_until,
    keep_readings,
    newest_run,
    note_planned,
    told_of_signals,
)
from tango_cnc.commands._many_nights import followed
from tango_cnc.commands._night_warm import warm
from tango_cnc.commands._night_world import RealControl, RealDisk
from tango_cnc.commands._simulated_nights import Event, Nobody, Story, Time, nights
from tango_cnc.commands._unreadable import machine_of, settings_of

__all__ = [
    "JOURNAL",
    "KEPT",
    "PLANNED",
    "Event",
    "Nobody",
    "RealControl",
    "RealDisk",
    "Story",
    "Time",
    "again",
    "as_of",
    "executed_until",
    "files_of",
    "followed",
    "keep_readings",
    "machine_of",
    "newest_run",
    "nights",
    "nights_of",
    "note_planned",
    "settings_of",
    "simulated",
    "told_of_signals",
    "twin",
    "warm",
]
