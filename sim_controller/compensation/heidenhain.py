"""A TNC with .COM and .CMA tables and a kinematics description."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, Trim, alarm, moved_axes, number, text_of, there


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for tables that it refuses."""
    trims: list[Trim] = []
    lines = [line.split() for line in text_of(folder, "AXIS.CMA").splitlines()]
    active = [row for row in lines if len(row) > 2 and row[1] == "*"]
    if len(active) > 1:
        raise InputError("AXIS.CMA: the simulated control refuses it: more than one active line")
    if active:
        axes = next(row[2:] for row in lines if row[:2] == ["NR", "ACTIVE"])
        for axis, name in zip(axes, active[0][2:], strict=True):
            if axis not in machine.names or not there(folder, name):
                raise InputError(f"AXIS.CMA: the simulated control refuses it: axis {axis}, file {name}")
            trims += _com(folder, name, axis, machine)
    return Applied(machine, _description(folder, machine), None, trims)


def _com(folder: Path, name: str, by: str, machine: Machine) -> list[Trim]:
    rows: list[list[float]] = []
    columns: list[str] = []
    ended = False
    for i, line in enumerate(text_of(folder, name).splitlines(), 1):
        words = line.split()
        if words[:1] == ["BEGIN"]:
            continue
        if words[:1] == ["[END]"]:
            ended = True
        elif words[:1] == ["NR"]:
            columns = words[1:]
            if columns[:2] != ["AXISPOS", "BACKLASH"] or any(c not in machine.names for c in columns[2:]):
                raise alarm(name, i, f"columns {' '.join(columns)}")
        elif len(words) != len(columns) + 1 or words[0] != str(len(rows)):
            raise alarm(name, i, f"found {line!r}; allowed: row {len(rows)} with {len(columns)} values")
        else:
            rows.append([number(word, name, i) for word in words[1:]])
    if not ended or not 2 <= len(rows) <= 256:
        raise InputError(f"{name}: the simulated control refuses it: {len(rows)} rows, {'' if ended else 'no '}[END]")
    table = np.array(rows)
    step = np.diff(table[:, 0])
    if step.min() <= 0 or np.ptp(step) > 1e-4:
        raise InputError(f"{name}: the simulated control refuses it: points are not equidistant")
    where = table[:, 0] * _scale(machine, by)
    result = []
    for j, out in enumerate(columns[2:], 2):
        values = table[:, j] * _scale(machine, out)
        back = table[:, 1] * _scale(machine, by) if out == by else 0.0  # values for negative travel
        result.append(Trim(out, by, where, values, values + back))
    return result


def _scale(machine: Machine, axis: str) -> float:
    return 1.0 if axis in machine.linear else math.pi / 180


def _description(folder: Path, machine: Machine) -> Callable[[Array], Array] | None:
    text = text_of(folder, "kinematics.txt")
    if not text:
        return None
    shift, turn = np.zeros(3), np.zeros(3)
    points: dict[str, Array] = {}
    directions: dict[str, Array] = {}
    for i, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words[:1] == ["Trans"] and len(words) == 3 and words[1] in "XYZABC":
            value = number(words[2], "kinematics.txt", i)
            if words[1] in "XYZ":
                shift["XYZ".index(words[1])] += value
            else:
                turn["ABC".index(words[1])] += math.radians(value)
        elif words[:1] == ["MachAxis"] and len(words) == 2 and words[1] in (*machine.linear, *machine.rotary):
            axis = machine.axis(words[1])
            if axis.name in machine.rotary:
                points[axis.name] = np.array(axis.point) + shift
            directions[axis.name] = np.array(axis.direction) + np.cross(turn, np.array(axis.direction))
        elif words[:1] not in (["BEGIN"], ["[END]"]):
            raise alarm("kinematics.txt", i, f"found {line!r}")
    if "[END]" not in text:
        raise InputError("kinematics.txt: the simulated control refuses it: no [END]")
    return moved_axes(machine, points, directions)
