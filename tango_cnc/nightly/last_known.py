"""Alarms that stand in a night that measured nothing: as the last night that measured left them."""

from __future__ import annotations

from typing import Any

from .lengths import as_seen_last
from .ports import Ports
from .scatter import with_scatter
from .sensors import celsius_of
from .standing import by_urgency, standing, unheard
from .warmth import as_warm_as

LOOKED = 40  # nights back for one that knew how warm the machine was


def as_known_last(world: Ports, machine: str, day: float, night: str) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """world, machine, day and date of a night that measured nothing → alarms of other nights that nobody has closed, and those that
    somebody ignores: what had gone again is gone as long as no night finds it otherwise. Raises TangoError, OSError.
    """
    waiting = standing(world.past, machine, day, {}, "none", world.happened)
    silent = unheard(world.past, machine, day, {}, "none")
    if not waiting and not silent:
        return [], []
    waiting = with_scatter(world.past, machine, waiting, None)
    silent = with_scatter(world.past, machine, silent, None, silent=True)
    recent = world.past.records(machine, LOOKED)
    last = next((celsius for r in recent if (celsius := celsius_of(r)) is not None), None)
    waiting = as_seen_last(waiting, recent)
    waiting, silent = (as_warm_as(of, last, False, night, recent) for of in (waiting, silent))
    return by_urgency(waiting), silent
