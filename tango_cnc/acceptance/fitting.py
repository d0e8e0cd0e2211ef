"""Does what the page states agree with what the fit used? Certificates with artefact.yaml, conditions with temperature.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, timedelta
from typing import Any

from ..iso230.temperature import Thermal
from ..records import Cell, InputError
from .order import Certificate, Order

ROUNDED = 0.6e-4  # mm: a certificate's length as it is written into artefact.yaml
TIP = 0.02  # mm, by which the diameter of a tip may differ from twice tip_radius: facets take up the rest
OLD = 3 * 366  # days that a certificate serves where it does not say how long
WEST, EAST = timedelta(hours=12), timedelta(hours=14)  # local time beside UTC, at most
APART = {"machine": 1.0, "table": 2.0, "air": 2.0}  # K


def contradictions(order: Order, cell: Cell, thermal: Thermal | None, ran: tuple[datetime, datetime] | None) -> None:
    """order, cell, temperatures, days on which the readings were made → nothing. Raises InputError where they contradict."""
    for c in order.certificates:
        _certificate(c, cell, order.file)
    told = order.temperatures
    if thermal is not None:
        on_table = thermal.table or thermal.bar
        stated = {"machine": thermal.machine, "table": on_table} | ({} if thermal.air is None else {"air": thermal.air})
        for key, known in stated.items():
            value, most = told.get(f"{key}_temperature"), APART[key] + 3 * known.std
            if value is not None and abs(value - known.value) > most:
                raise InputError(
                    f"{order.file}: conditions.{key}_temperature: found {value:g} °C, and temperature.yaml says "
                    f"{known.value:g} °C; allowed: within {most:g} K of it, or one of the two files is wrong"
                )
    if order.performed is not None and ran is not None:
        first, last = order.performed
        begun, ended = ran
        if last < (begun - WEST).date() or first > (ended + EAST).date():
            raise InputError(
                f"{order.file}: performed: found {_span(first, last)}, and the readings are of {begun:%Y-%m-%d %H:%M} to "
                f"{ended:%Y-%m-%d %H:%M} UTC; "
                "allowed: the day on which they were made"
            )


def _span(first: date, last: date) -> str:
    return f"{first}" if first == last else f"{first} to {last}"


def _certificate(c: Certificate, cell: Cell, file: str) -> None:
    where = f"{file}: certificates: {c.of} {c.number}"
    if c.of == "scale bar":
        bar = cell.artefact.scale_bar
        if bar is None:
            raise InputError(f"{where}: found a scale bar; allowed: none, as artefact.yaml has none")
        assert c.length is not None and c.std is not None
        if abs(c.length - bar.length) > ROUNDED:
            raise InputError(f"{where}: found {c.value}; allowed: {bar.length:.4f} mm, the length that artefact.yaml gives the fit")
        if c.std > bar.uncertainty * 1.001:
            raise InputError(
                f"{where}: found {c.uncertainty} (k = {c.k:g}), a standard uncertainty of {c.std * 1e3:.3g} µm; allowed: at most "
                f"{bar.uncertainty * 1e3:.3g} µm, which artefact.yaml gives the fit. Correct the file that is wrong"
            )
    if c.of == "calibrated facets" and not _calibrated(cell):
        raise InputError(f"{where}: found calibrated facets; allowed: none, as no facet of artefact.yaml has an uncertainty")
    if c.of == "tip":
        diameter = 2 * cell.machine.probe.tip_radius
        assert c.length is not None
        if abs(c.length - diameter) > TIP:
            raise InputError(f"{where}: found a diameter of {c.value}; allowed: {diameter:g} mm, twice tip_radius of machine.yaml")


def other_bar(order: Order, changed: Sequence[tuple[str, Any, Any]]) -> tuple[str, str]:
    """order, keys of artefact.yaml that have changed since the readings were made, with what they were and are → why nothing is
    decided by these readings; else what the sheet says of the bar. '' where its length is that of the run.

    A bar may have got its certificate after the run. Nobody but the laboratory knows that: it says so by `before`.
    """
    then, now = next(((a, b) for key, a, b in changed if key == "scale_bar.length"), (None, None))
    if not isinstance(then, int | float) or not isinstance(now, int | float) or abs(then - now) <= ROUNDED:
        return "", ""
    mine = next((c for c in order.certificates if c.of == "scale bar" and c.before is not None), None)
    if mine is not None and mine.before is not None and abs(mine.before - then) <= ROUNDED:
        return "", (
            f"scale bar: artefact.yaml gave it {then:.4f} mm when it was touched; since then it has {now:.4f} mm, by certificate "
            f"{mine.number} of {mine.issued}"
        )
    return (
        f"the scale bar is {now:.4f} mm long in artefact.yaml, and was {then:.4f} mm when it was touched, so nothing says "
        "which bar these readings are of. If it is another bar, measure with it. If its certificate came after the run, state in "
        f"{order.file} what it corrects: at the certificate of the bar, before: {then:.4f} mm"
    ), ""


def _calibrated(cell: Cell) -> bool:
    return any(f.uncertainty is not None for f in cell.artefact.facets.values())


def untraced(order: Order, cell: Cell, scales: bool, day: date) -> tuple[str, ...]:
    """order, cell, whether scales at a temperature are stated, day of issue → sentences: what traceability lacks."""
    needed = [
        *(["scale bar"] if cell.artefact.scale_bar is not None else []),
        *(["calibrated facets"] if _calibrated(cell) else []),
    ]
    needed += ["thermometer"] if scales else []
    found = [f"no certificate of the {name}" for name in needed if not _of(order.certificates, name)]
    for c in order.certificates:
        if c.valid_until is not None and c.valid_until < day:
            found.append(f"the certificate {c.number} was valid until {c.valid_until}")
        elif c.valid_until is None and (day - c.issued).days > OLD:
            found.append(f"the certificate {c.number} is of {c.issued} and does not say until when it is valid (valid_until)")
    return tuple(found or ([] if order.certificates else ["no certificate"]))


def _of(certificates: Sequence[Certificate], name: str) -> bool:
    return any(c.of == name for c in certificates)
