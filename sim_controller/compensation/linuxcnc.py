"""LinuxCNC as its source has it: usrmotLoadComp, control.c, trtfuncs.c, matrixkins.comp."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from tango_cnc.records import Array, InputError, Machine

from . import LARGEST, Applied, Trim, alarm, text_of, there

MOST = 256  # EMCMOT_COMP_SIZE
Kinematics = Callable[[Array], Array]


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → what LinuxCNC does. Raises InputError for what it refuses at start."""
    letters = (*machine.linear, *machine.rotary)
    trims = []
    settings: dict[str, str] = {}
    sections: dict[int, dict[str, str]] = {}
    for line in text_of(folder, "compensation.ini").splitlines():
        head, pair = re.match(r"\[JOINT_(\d)\]", line), re.match(r"\s*(\w+)\s*=\s*(.*?)\s*$", line)
        if head:
            joint, settings = int(head[1]), {}
            sections[joint] = settings
        elif pair:
            settings[pair[1]] = pair[2]
    for joint, settings in sections.items():
        if "COMP_FILE" in settings:
            name = settings["COMP_FILE"]
            if joint >= len(letters) or not there(folder, name):
                raise InputError(f"compensation.ini: the simulated control refuses it: no joint {joint}, or no file {name}")
            trims.append(_comp(folder, name, letters[joint], machine, int(settings.get("COMP_FILE_TYPE", "0"))))
    pins = {}
    for i, line in enumerate(text_of(folder, "compensation.hal").splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        if len(words) != 3 or words[0] != "setp" or not re.fullmatch(r"[-+]?\d*\.?\d+([eE][-+]?\d+)?", words[2]):
            raise alarm("compensation.hal", i, f"found {line!r}; allowed: setp PIN NUMBER")
        pins[words[1]] = float(words[2])
    return Applied(machine, _kinematics(pins, machine), None, trims, switched="trt-kins" in "".join(pins))


def _comp(folder: Path, name: str, letter: str, machine: Machine, kind: int) -> Trim:
    scale = 1.0 if letter in machine.linear else math.pi / 180
    rows: list[tuple[float, float, float]] = []
    for i, line in enumerate(text_of(folder, name).splitlines(), 1):
        found = re.match(r"\s*([-+.\deE]+)\s+([-+.\deE]+)\s+([-+.\deE]+)", line)
        try:
            a, b, c = (float(text) for text in found.groups()) if found else ()  # type: ignore[misc]
        except ValueError:
            break  # the loader stops here, and says nothing
        if not max(abs(a), abs(b), abs(c)) <= LARGEST:
            raise alarm(name, i, f"allowed: up to {LARGEST:g}")
        if rows and a <= rows[-1][0]:
            raise alarm(name, i, "compensation points must ascend")
        if len(rows) == MOST:
            raise alarm(name, i, f"more than {MOST} points")
        rows.append((a, a - b, a - c) if kind == 0 else (a, b, c))
    if not rows:
        rows = [(0.0, 0.0, 0.0)]
    table = scale * np.array(rows)
    return Trim(letter, letter, table[:, 0], table[:, 1], table[:, 2])


def _kinematics(pins: Mapping[str, float], machine: Machine) -> Kinematics | None:
    module = next(iter(pins), "").partition(".")[0]
    if not module:
        return None
    values = {name.partition(".")[2]: value for name, value in pins.items()}
    if module == "matrixkins":
        matrix = np.array([[values.get(f"C_{a}{b}", float(a == b)) for b in "xyz"] for a in "xyz"])
        columns = [machine.column(name) for name in "XYZ"]

        def matrixkins(positions: Array) -> Array:
            result = positions.copy()
            result[:, columns] = positions[:, columns] @ matrix.T
            return result

        return matrixkins
    cradle = {"xyzac-trt-kins": "A", "xyzbc-trt-kins": "B"}.get(module)
    if cradle is None:
        raise InputError(f"compensation.hal: the simulated control refuses it: no kinematics module {module}")
    home = np.array(machine.spindle.point)
    table, swing = np.array(machine.axis("C").point) - home, np.array(machine.axis(cradle).point) - home
    before = {"x-rot-point": table[0], "y-rot-point": table[1], "z-rot-point": swing[2], "z-offset": 0.0}
    before["x-offset" if cradle == "B" else "y-offset"] = swing[0] - table[0] if cradle == "B" else swing[1] - table[1]

    def trt(positions: Array) -> Array:
        tool = machine.probe.length
        world = _forward(positions, machine, cradle, before, tool)
        return _inverse(world, positions, machine, cradle, before | values, tool)

    return trt


def _turns(positions: Array, machine: Machine, cradle: str) -> tuple[Array, Array]:
    """→ (n, 3, 3) turn of the cradle, (n, 3, 3) of the table, as trtfuncs.c has their signs."""
    a, c = positions[:, machine.column(cradle)], positions[:, machine.column("C")]
    zero, one = np.zeros_like(a), np.ones_like(a)
    if cradle == "A":
        swing = [[one, zero, zero], [zero, np.cos(a), -np.sin(a)], [zero, np.sin(a), np.cos(a)]]
    else:
        swing = [[np.cos(a), zero, np.sin(a)], [zero, one, zero], [-np.sin(a), zero, np.cos(a)]]
    table = [[np.cos(c), -np.sin(c), zero], [np.sin(c), np.cos(c), zero], [zero, zero, one]]
    return np.moveaxis(np.array(swing), 2, 0), np.moveaxis(np.array(table), 2, 0)


def _centres(pins: Mapping[str, float], tool: float) -> tuple[Array, Array]:
    """→ point of the table axis, offset of the cradle axis from it; the tool makes the offset along z longer."""
    centre = np.array([pins.get("x-rot-point", 0.0), pins.get("y-rot-point", 0.0), pins.get("z-rot-point", 0.0)])
    return centre, np.array([pins.get("x-offset", 0.0), pins.get("y-offset", 0.0), pins.get("z-offset", 0.0) + tool])


def _forward(positions: Array, machine: Machine, cradle: str, pins: Mapping[str, float], tool: float) -> Array:
    swing, table = _turns(positions, machine, cradle)
    centre, offset = _centres(pins, tool)
    joints = positions[:, [machine.column(name) for name in "XYZ"]]
    inner = np.einsum("nji,nj->ni", swing, joints - offset - centre) + offset
    return np.asarray(np.einsum("nji,nj->ni", table, inner) + centre)


def _inverse(world: Array, positions: Array, machine: Machine, cradle: str, pins: Mapping[str, float], tool: float) -> Array:
    swing, table = _turns(positions, machine, cradle)
    centre, offset = _centres(pins, tool)
    inner = np.einsum("nij,nj->ni", table, world - centre) - offset
    result = positions.copy()
    result[:, [machine.column(name) for name in "XYZ"]] = np.einsum("nij,nj->ni", swing, inner) + offset + centre
    return result
