"""Nights of a simulated machine that are judged in full, and ways to spoil one: none of it knows how a night is judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from support.nights_parts import nights_of, simulated
from tango_cnc.files import readings_text
from tango_cnc.files.nightly import Nightly
from tango_cnc.plan import plan
from tango_cnc.records import Cell, Readings

FIRST = datetime(2026, 10, 1, 2, 0, tzinfo=UTC)
FEED = 180 / 60  # mm/s
SPOILT = (
    "late probe, 15 µm",
    "probe that scatters by 5 µm",
    "5 % outliers of 50 to 100 µm",
    "warm-up of 20 µm",
    "swapped facets",
    "half of the touches missing",
    "table knocked by 20 µm",
)


@dataclass(frozen=True)
class Fault:
    """What is wrong with a night: an effect of the true machine, what becomes of its readings, where the table goes (mm)."""

    effect: Mapping[str, Any] | None = None
    then: Callable[[Readings], Readings] | None = None
    table: tuple[float, float, float] | None = None


def fault(name: str, facets: Sequence[int | str]) -> Fault:
    """one of `SPOILT`, facets of the table → what is wrong."""
    return {
        "late probe, 15 µm": Fault({"cause": "trigger_latency", "delay": 0.015 / FEED}),
        "probe that scatters by 5 µm": Fault({"cause": "noise_level", "amplitude": 0.005}),
        "5 % outliers of 50 to 100 µm": Fault({"cause": "outliers", "amplitude": 0.1, "rate": 0.05}),
        "warm-up of 20 µm": Fault({"cause": "thermal_drift", "amplitude": 0.020, "tau": 900, "direction": [0, 0.7, 0.7]}),
        "swapped facets": Fault({"cause": "swapped_facets", "facets": list(facets[:2])}),
        "half of the touches missing": Fault(then=lambda read: read.rows(np.arange(len(read) // 2))),
        "table knocked by 20 µm": Fault(table=(0.018, 0.009, 0.0)),
    }[name]


@contextmanager
def judged_in_full(cell: Cell, settings: Nightly) -> Iterator[None]:
    """While it is in force, simulated nights of this cell are judged as those of a real machine; its plan is made once."""
    before = simulated.plan, simulated.nights_of
    made = plan(cell)
    analysis = nights_of(cell, settings, made, deep=True)
    simulated.plan, simulated.nights_of = lambda cell: made, lambda cell, settings, made, deep=True: analysis  # type: ignore[assignment]
    try:
        yield
    finally:
        simulated.plan, simulated.nights_of = before


@contextmanager
def spoilt(wrong: Fault) -> Iterator[None]:
    """While it is in force, every night is spoilt (a table is knocked by an event of the story)."""
    before = simulated._Machine.measure

    def measure(machine: Any, kind: str, touches: Any) -> Any:
        truth = machine.truth
        if wrong.effect is not None:
            machine.truth = replace(truth, effects=(*truth.effects, wrong.effect))
        try:
            found = before(machine, kind, touches)
        finally:
            machine.truth = truth
        if wrong.then is None or found.readings is None:
            return found
        read = wrong.then(found.readings)
        return replace(found, readings=read, text=readings_text(read))

    simulated._Machine.measure = measure  # type: ignore[method-assign]
    try:
        yield
    finally:
        simulated._Machine.measure = before  # type: ignore[method-assign]


def said(record: Mapping[str, Any]) -> str:
    """record → what a morning says: good, set apart (single touches), alarm, doubtful …"""
    if record["verdict"] == "good" and record.get("outliers"):
        return "set apart"
    return "alarm" if record["alarms"] and record["verdict"] != "doubtful" else str(record["verdict"])
