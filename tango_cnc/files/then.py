"""machine.yaml and artefact.yaml as they were when readings were made: their texts → records, and what has changed since."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ..records import Artefact, Cell, InputError, Machine
from .artefact import read_artefact
from .cell import read_machine
from .checked import parse
from .origin import cell_texts, look_up


def machine_and_artefact(folder: Path) -> dict[str, str]:
    """folder of a cell → texts of its `machine` and its `artefact`."""
    return {role: text for role, (_, text) in _roles(cell_texts(folder)).items()}


def at_that_time(cell: Cell, readings: Path) -> Cell:
    """cell, readings → the cell with the machine and the artefact that it had when they were made, where that is on record."""
    texts = look_up(readings).known.get("cell")
    return with_texts(cell, {role: text for role, (_, text) in _roles(texts if isinstance(texts, dict) else {}).items()}, readings)


def with_texts(cell: Cell, texts: Mapping[str, str], beside: Path) -> Cell:
    """cell, texts by role, a file beside which they were found → the cell with these."""
    if "machine" in texts:
        cell = replace(cell, machine=read_machine(beside.with_name("machine.yaml"), texts["machine"]))
    if "artefact" in texts:
        cell = replace(cell, artefact=read_artefact(beside.with_name("artefact.yaml"), texts["artefact"]))
    return cell


def _roles(texts: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """{file: its text} → {machine, artefact: file and text}."""
    found = {}
    for name, text in texts.items():
        with suppress(InputError):
            keys = set(parse(Path(name), text).plain())
            if "topology" in keys:
                found["machine"] = name, text
            elif "facets" in keys and "approach" not in keys:
                found["artefact"] = name, text
    return found


def moved(then: Cell, now: Cell) -> list[str]:
    """cell at the time of two runs → what errors are counted from, and is not the same, such as axes.C.point and facets.3."""
    result = [] if then.machine.topology == now.machine.topology else ["topology"]
    result += _axes(then.machine, now.machine) if not result else []
    return result + _places(then.artefact, now.artefact)


def _axes(then: Machine, now: Machine) -> list[str]:
    before = {axis.name: axis for axis in then.axes}
    return [
        f"axes.{axis.name}.{key}"
        for axis in now.axes
        for key in ("kind", "direction", "point")
        if getattr(axis, key) != getattr(before[axis.name], key)
    ]


def _places(then: Artefact, now: Artefact) -> list[str]:
    found = [f"facets.{name}" for name, facet in now.facets.items() if name in then.facets and then.facets[name] != facet]
    found += [f"balls.{name}" for name, ball in now.balls.items() if name in then.balls and then.balls[name] != ball]
    return found + (["scale_bar"] if then.scale_bar != now.scale_bar else [])
