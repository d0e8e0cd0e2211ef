"""What several formats write: one row a night and parameter."""

from __future__ import annotations

from ..store import History

COLUMNS = ("machine", "night", "start_utc", "entry", "kind", "verdict", "parameter", "value", "std", "unit", "simulated")
Row = tuple[str, str, str, int, str, str, str, float, float, str, bool]


def rows(history: History, machine: str) -> list[Row]:
    """history, machine → rows of `COLUMNS`, oldest night first; values in mm, rad, mm/mm …"""
    nights = {n.entry: n for n in history.nights(machine)}
    found: list[Row] = []
    simulated = history.simulated(machine)
    for name in history.parameters(machine):
        trend = history.trend(machine, name)
        for i, entry in enumerate(trend.entries):
            n = nights[entry]
            value, std = float(trend.value[i]), float(trend.std[i])
            found.append(
                (machine, n.night, n.start_utc, entry, n.kind, n.verdict, name, value, std, trend.unit, entry in simulated)
            )
    return sorted(found, key=lambda row: (row[2], row[3], row[6]))
