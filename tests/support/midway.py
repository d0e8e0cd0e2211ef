"""A machine that is knocked while it is measured: touches before one moment are of one machine, those after it of another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from support.nights_parts import simulated
from tango_cnc.files import readings_text


@contextmanager
def knocked(errors: Mapping[str, float], share: float, table: tuple[float, float, float] | None = None) -> Iterator[None]:
    """errors that are larger (mm, rad), share of the run after which they are, way of the table (mm) → every night within is so."""
    before = simulated._Machine.measure

    def measure(machine: Any, kind: str, touches: Any) -> Any:
        truth, scatter = machine.truth, machine.rng.bit_generator.state
        whole = before(machine, kind, touches)
        machine.rng.bit_generator.state = scatter  # the same scatter of the touches
        facets = dict(truth.facets)
        if table is not None:
            facets = {i: facets.get(i, 0.0) + float(np.dot(table, f.normal)) for i, f in machine.cell.artefact.facets.items()}
        moved = {**truth.errors, **{name: truth.errors.get(name, 0.0) + size for name, size in errors.items()}}
        machine.truth = replace(truth, errors=moved, facets=facets)
        try:
            other = before(machine, kind, touches)
        finally:
            machine.truth = truth
        position, first = whole.readings.position.copy(), int(share * len(whole.readings))
        position[first:] = other.readings.position[first:]
        read = replace(whole.readings, position=position)
        return replace(whole, readings=read, text=readings_text(read))

    simulated._Machine.measure = measure  # type: ignore[method-assign]
    try:
        yield
    finally:
        simulated._Machine.measure = before  # type: ignore[method-assign]
