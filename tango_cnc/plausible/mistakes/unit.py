"""Numbers in another unit: inch, metre or centimetre for millimetre, radian for degree, a diameter for a radius."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...records import Artefact, Machine, Vector
from ...texts import joined, say
from ._case import Case, Hypothesis, with_positions, with_probe

LENGTHS = {25.4: "inch", 1000.0: "m", 10.0: "cm", 1 / 25.4: "mm", 1e-3: "um"}  # mm: what is taken for inch
ANGLES = {
    180 / math.pi: "radian",
    math.pi / 180: "degrees",
    360.0: "turns",
    1 / 3600: "seconds",
    1 / 60: "minutes",
    1e-3: "thousandths",
}


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → table, machine or columns of the readings in every unit that people mix up."""
    machine, readings = case.machine, case.readings
    linear = [machine.column(name) for name in machine.linear]
    turning = [name for name in machine.rotary if np.ptp(readings.position[:, machine.column(name)])]
    for factor, unit in LENGTHS.items():
        yield Hypothesis(
            say("mistake.unit.readings_fit_numbers_artefact_yaml", unit=say(f"mistake.unit.unit_{unit}")),
            "artefact",
            "facets",
            say("mistake.unit.multiply_every_length", factor=f"{factor:g}"),
            artefact=scaled(case.artefact, factor),
        )
        yield Hypothesis(
            say("mistake.unit.readings_fit_readings", unit=say(f"mistake.unit.unit_{unit}")),
            "readings",
            ", ".join(machine.linear),
            say("mistake.unit.multiply_them", factor=f"{factor:g}"),
            readings=with_positions(readings, _times(readings.position, linear, factor)),
        )
        yield Hypothesis(
            say("mistake.unit.readings_fit_lengths_machine_yaml", unit=say(f"mistake.unit.unit_{unit}")),
            "machine",
            "axes",
            say("mistake.unit.multiply_every_length", factor=f"{factor:g}"),
            machine=_machine(machine, factor),
            price=0.5,
        )
    for name in machine.linear:
        for factor in (2.0, 0.5, 10.0, 0.1, 25.4, 1 / 25.4, 1000.0, 1e-3):
            yield Hypothesis(
                say("mistake.unit.readings_fit_counts_for_mm", name=name, factor=f"{1 / factor:g}"),
                "readings",
                name,
                say("mistake.unit.multiply_column_diameter_programming_another", name=name, factor=f"{factor:g}"),
                readings=with_positions(readings, _times(readings.position, [machine.column(name)], factor)),
                price=1.0,
            )
    for factor, unit in ANGLES.items():
        for names in ([turning] if len(turning) > 1 else []) + [[name] for name in turning]:
            columns = [machine.column(name) for name in names]
            yield Hypothesis(
                say(
                    f"mistake.unit.angle_{'one' if len(names) == 1 else 'many'}",
                    names=names[0] if len(names) == 1 else joined(say("mistake.unit.and"), names),
                    unit=say(f"mistake.unit.unit_{unit}"),
                ),
                "readings",
                ", ".join(names),
                say(f"mistake.unit.multiply_{'it' if len(names) == 1 else 'them'}", factor=f"{factor:g}"),
                readings=with_positions(readings, _times(readings.position, columns, factor)),
                price=0.0 if unit == "radian" else 1.0,
            )


def _times(position: np.ndarray, columns: list[int], factor: float) -> np.ndarray:
    changed = np.array(position)
    changed[:, columns] *= factor
    return changed


def _scaled(v: Vector, factor: float) -> Vector:
    return v[0] * factor, v[1] * factor, v[2] * factor


def scaled(artefact: Artefact, factor: float) -> Artefact:
    """artefact, factor → every length of it multiplied."""
    facets = {
        key: replace(
            f,
            point=_scaled(f.point, factor),
            surface=None if f.surface is None else replace(f.surface, radius=f.surface.radius * factor),
        )
        for key, f in artefact.facets.items()
    }
    balls = {key: replace(b, centre=_scaled(b.centre, factor), radius=b.radius * factor) for key, b in artefact.balls.items()}
    bar = None if artefact.scale_bar is None else replace(artefact.scale_bar, length=artefact.scale_bar.length * factor)
    return replace(artefact, facets=facets, balls=balls, scale_bar=bar)


def _machine(machine: Machine, factor: float) -> Machine:
    axes = tuple(replace(axis, point=_scaled(axis.point, factor)) for axis in machine.axes)
    probe = machine.probe
    return with_probe(replace(machine, axes=axes), length=probe.length * factor, tip_radius=probe.tip_radius * factor)
