"""A report beside the newest night → what the machine has otherwise than when these readings were made."""

from __future__ import annotations

import numpy as np

from ..state.volume import levers_of
from .days import day
from .facts import Facts, effects
from .plain import amount, value_text
from .texts import Texts
from .units import shown
from .words import spoken


def _moved(f: Facts, name: str) -> float | None:
    """facts, parameter → its value of the newest night where that differs from these readings (95 %), in its unit; else None."""
    p, here = f.nights.parameter(name) if f.nights is not None else None, f.result.parameters.get(name)
    if p is None or here is None:
        return None
    apart = abs(float(p["value"]) - here.value)
    return float(p["value"]) if apart > 2 * float(np.hypot(float(p.get("std") or 0.0), here.std)) else None


def most_of_tip(f: Facts) -> str:
    """facts → the error that the largest part of the largest error at the tool tip comes from: without it that error would be
    smallest. Where nothing is known of the tool tip, the one that does most to the touches; '' for none.
    """
    lever, gone = levers_of(f.result), None if f.control is None else f.control.gone
    have = f.result.values if gone is None else f.result.values - gone
    whole, left = lever @ have, dict[str, float]()
    for i, name in enumerate(map(f.result.selection.label, f.result.model.names)):
        if name in f.result.parameters and lever[:, :, i].any():
            left[name] = float(np.linalg.norm(whole - lever[:, :, i] * have[i], axis=1).max())
    return min(left, key=left.__getitem__) if f.tip is not None and left else next(iter(effects(f.result)), "")


def moved_most(f: Facts) -> str:
    """facts → the error that these readings have otherwise than the newest night and whose change does most to the tool tip; ''
    where they agree.
    """
    lever, found = levers_of(f.result), dict[str, float]()
    places = {f.result.selection.label(name): i for i, name in enumerate(f.result.model.names)}
    for name in effects(f.result):
        if (there := _moved(f, name)) is not None:
            most = float(np.linalg.norm(lever[:, :, places[name]], axis=1).max())
            found[name] = most * abs(f.result.parameters[name].value - there)
    return max(found, key=found.__getitem__, default="")


def of_night(f: Facts, name: str, t: Texts) -> str:
    """facts, parameter, texts → its value of the newest night where that is another one; else nothing."""
    value = _moved(f, name)
    if value is None or f.nights is None:
        return ""
    factor, unit = f.wishes.units.coefficient(f.result.parameters[name].unit)
    std = float((f.nights.parameter(name) or {}).get("std") or 0.0) * abs(factor)
    return t("table.of_night", date=day(f.nights.measured_on, t, False), value=value_text(value * factor, std), unit=unit)


def as_probed(f: Facts, t: Texts) -> str:
    """facts, texts → that the values are those that probing sees, where a compensation in the control takes some away of parts;
    '' without one.
    """
    if f.control is None or f.control.gone is None:
        return ""
    return t("report.as_probed", number=f.control.beneath or f.control.number, target=f.control.target)


def since_then(f: Facts, t: Texts, key: str = "report.since_then") -> str:
    """facts, texts, key of the sentence → what the newest night has otherwise than these readings, the most telling first; nothing
    where they agree.
    """
    name, machine = moved_most(f), f.cell.machine
    if not name or f.nights is None:
        return ""
    size, unit = shown(f.result.parameters[name].unit)
    here, there = f.result.parameters[name].value * size, (_moved(f, name) or 0.0) * size
    values = {key: amount(value, unit, f.wishes.units, t) for key, value in (("here", here), ("there", there))}
    signs = {key: "−" if value < 0 else "" for key, value in (("here", here), ("there", there))}
    told = {key: signs[key] + text for key, text in values.items()}
    if key == "todo.grown" and name in f.nights.repaired:
        key, told["owner"] = "todo.grown_repaired", f.nights.repaired[name]
    return t(
        key,
        what=f"{spoken(name, machine, t)[:1].upper()}{spoken(name, machine, t)[1:]}",
        date=day(f.nights.measured_on, t),
        **told,
    )
