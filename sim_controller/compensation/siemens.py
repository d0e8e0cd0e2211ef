"""SINUMERIK: CEC and ENC_COMP tables, reversal values, fine offsets and axis vectors of a tool carrier."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import Applied, Trim, alarm, moved_axes, number, text_of

VARIABLE = re.compile(r"\$(?P<name>\w+)\[(?P<index>[^\]]*)\]\s*=\s*(?P<value>[^;]+)")
CEC_SIGN, ENC_SIGN = 1.0, -1.0  # CEC is added to the command; ENC_COMP to the encoder, so the axis goes less far
POINTS = 5000  # of a table: that the memory of a control is no larger is unconfirmed


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what the control does. Raises InputError for what it refuses while reading in."""
    letters = (*machine.linear, *machine.rotary)
    axes = {f"AX{i + 1}": name for i, name in enumerate(letters)}
    trims = [*_cec(_variables(folder, "cec.ini"), machine, axes), *_enc(_variables(folder, "enc_comp.ini"), machine, axes)]
    reversal = {}
    for name, index, value, line in _variables(folder, "reversal.mpf", ended=False):
        axis = axes.get(index.split(",")[-1])
        if name != "MA_BACKLASH" or axis is None or not index.startswith("0,"):
            raise alarm("reversal.mpf", line, f"${name}[{index}]")
        reversal[axis] = number(value, "reversal.mpf", line) * (1.0 if axis in machine.linear else math.pi / 180)
    carrier = _variables(folder, "kinematics.mpf")
    return Applied(machine, _kinematics(carrier, machine) if carrier else None, None, trims, reversal=reversal)


def _variables(folder: Path, file: str, *, ended: bool = True) -> list[tuple[str, str, str, int]]:
    text = text_of(folder, file)
    result = []
    lines = text.splitlines()
    for i, line in enumerate(lines, 1):
        bare = line.split(";")[0].strip()
        found = VARIABLE.fullmatch(bare)
        if found:
            result.append((found["name"], found["index"].replace(" ", ""), found["value"].strip(), i))
        elif bare and bare not in ("CHANDATA(1)", "M17") and not bare.startswith("%_N_"):
            raise alarm(file, i, f"found {line!r}; allowed: $VARIABLE[index]=value")
    if ended and text and lines[-1].strip() != "M17":
        raise InputError(f"{file}: the simulated control refuses it: no M17 at the end")
    return result


def _table(file: str, values: Mapping[int, float], frame: Mapping[str, float], scale: float) -> tuple[Array, Array]:
    """→ points and values. A point that was not written is 0, as in the memory of the control."""
    step, low, high = frame.get("STEP", 0.0), frame.get("MIN", 0.0), frame.get("MAX", 0.0)
    if step <= 0 or high <= low:
        raise InputError(f"{file}: the simulated control refuses it: STEP {step:g}, MIN {low:g}, MAX {high:g}")
    if (high - low) / step > POINTS:
        raise InputError(
            f"{file}: the simulated control refuses it: MIN {low:g} to MAX {high:g} by {step:g} is above {POINTS} points"
        )
    count = round((high - low) / step) + 1
    if any(i < 0 or i >= count for i in values):
        raise InputError(f"{file}: the simulated control refuses it: an index outside of 0 to {count - 1}")
    points = np.asarray(scale * (low + step * np.arange(count)), dtype=np.float64)
    return points, np.array([values.get(i, 0.0) for i in range(count)])


def _scale(machine: Machine, axis: str) -> float:
    return 1.0 if axis in machine.linear else math.pi / 180


def _modulo(machine: Machine, axis: str) -> bool:
    """→ whether the control counts the axis from 0 to 360 degrees: a rotary axis without limits, whatever its tables say."""
    return axis in machine.rotary and machine.axis(axis).travel is None


def _cec(found: list[tuple[str, str, str, int]], machine: Machine, axes: Mapping[str, str]) -> list[Trim]:
    values: dict[int, dict[int, float]] = {}
    frames: dict[int, dict[str, float]] = {}
    ways: dict[int, dict[str, str]] = {}
    for name, index, value, line in found:
        parts = index.split(",")
        if not all(part.isdigit() for part in parts):
            raise alarm("cec.ini", line, f"index [{index}]")
        t = int(parts[0])
        if name == "AN_CEC" and len(parts) == 2:
            values.setdefault(t, {})[int(parts[1])] = number(value, "cec.ini", line)
        elif name in ("AN_CEC_INPUT_AXIS", "AN_CEC_OUTPUT_AXIS"):
            if value.strip("()") not in axes:
                raise alarm("cec.ini", line, f"axis {value}")
            ways.setdefault(t, {})[name[7:-5]] = axes[value.strip("()")]
        elif name.startswith("AN_CEC_"):
            frames.setdefault(t, {})[name[7:]] = number(value, "cec.ini", line)
        else:
            raise alarm("cec.ini", line, f"${name}[{index}]")
    trims = []
    for t, own in values.items():
        if set(ways.get(t, {})) != {"INPUT", "OUTPUT"}:
            raise InputError(f"cec.ini: the simulated control refuses it: table {t} lacks its axes")
        by, out = ways[t]["INPUT"], ways[t]["OUTPUT"]
        points, table = _table("cec.ini", own, frames.get(t, {}), _scale(machine, by))
        both = CEC_SIGN * _scale(machine, out) * table
        trims.append(Trim(out, by, points, both, both, _modulo(machine, by)))
    return trims


def _enc(found: list[tuple[str, str, str, int]], machine: Machine, axes: Mapping[str, str]) -> list[Trim]:
    values: dict[str, dict[int, float]] = {}
    frames: dict[str, dict[str, float]] = {}
    for name, index, value, line in found:
        parts = index.split(",")
        axis = axes.get(parts[-1])
        if axis is None or parts[0] != "0":
            raise alarm("enc_comp.ini", line, f"index [{index}]")
        if name == "AA_ENC_COMP" and len(parts) == 3 and parts[1].isdigit():
            values.setdefault(axis, {})[int(parts[1])] = number(value, "enc_comp.ini", line)
        elif name.startswith("AA_ENC_COMP_"):
            frames.setdefault(axis, {})[name[12:]] = number(value, "enc_comp.ini", line)
        else:
            raise alarm("enc_comp.ini", line, f"${name}[{index}]")
    trims = []
    for axis, own in values.items():
        points, table = _table("enc_comp.ini", own, frames.get(axis, {}), _scale(machine, axis))
        both = ENC_SIGN * _scale(machine, axis) * table
        trims.append(Trim(axis, axis, points, both, both, _modulo(machine, axis)))
    return trims


def _kinematics(found: list[tuple[str, str, str, int]], machine: Machine) -> Callable[[Array], Array]:
    """Type T: I3 leads from the tool to the second axis, I2 on to the first; P: I2 to the first, I3 to the second; M: both."""
    tool = [a for a in machine.tool_branch if a in machine.rotary]
    work = [a for a in machine.workpiece_branch if a in machine.rotary]
    carrier = {}
    for name, index, value, line in found:
        if not re.fullmatch(r"TC_CARR\d+", name):
            raise alarm("kinematics.mpf", line, f"${name}[{index}]")
        carrier[int(name[7:])] = number(value, "kinematics.mpf", line)
    i1, i2, i3, i4 = (np.array([carrier.get(40 + first + c, 0.0) for c in range(3)]) for first in (1, 4, 15, 18))
    first, second = (*tool, *work)
    if tool and work:
        sums, shift = (i1 + i2, i3 + i4), {first: i2, second: i3}
    elif work:
        sums, shift = (i2 + i3 + i4, i1), {first: i2, second: i2 + i3}
    else:
        sums, shift = (i1 + i2 + i3, i4), {first: i2 + i3, second: i3}
    if any(np.abs(s).max() > 1e-3 for s in sums):
        raise InputError("kinematics.mpf: the simulated control refuses it: the vectors do not close")
    directions = {}
    for n, axis in ((7, first), (10, second)):
        if n in carrier:
            vector = np.array([carrier.get(n + c, 0.0) for c in range(3)])
            if not 0.99 < np.linalg.norm(vector) < 1.01:
                raise InputError(f"kinematics.mpf: the simulated control refuses it: V of {axis} is no direction")
            directions[axis] = -vector if axis in work else vector
    return moved_axes(machine, {a: np.array(machine.axis(a).point) + s for a, s in shift.items()}, directions)
