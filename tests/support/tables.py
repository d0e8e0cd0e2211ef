"""Tables for controls that somebody has spoilt: small ones of every target, and the simulated control that reads them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_controller import compensation
from support.mutants import Reader
from tango_cnc.compensate import targets
from tango_cnc.files import read_cell
from tango_cnc.records import Array, Machine

ROOT = Path(__file__).parent.parent.parent
BEGINS = "@@@ "  # a line before each file: all files of a target are spoilt as one
VALUES = "  EXX1: {value: 0.0001, unit: mm/mm}\n  EA0C: {value: -2e-05, unit: rad}\n"  # of iso230.yaml


@cache
def machine() -> Machine:
    return read_cell(ROOT / "examples" / "trunnion").machine


@cache
def files(target: str) -> dict[str, str]:
    """target → {name: text} with three points a table, whatever is in them."""
    one, module = machine(), targets.load(target)
    limits = {axis.name: axis.travel or (-3.0, 3.0) for axis in one.axes if axis.name in (*one.linear, *one.rotary)}
    settings = targets.options(module, ["points=3"] if "points" in module.OPTIONS else [])
    request = targets.Request(one, limits, settings)
    module.check(request)
    held = module.held(request)
    made: dict[str, str] = module.files(request, held, {h.place: h.base + 0.001 * (i % 7 - 3) for i, h in enumerate(held)})
    return {name: text + VALUES * (name == "iso230.yaml") for name, text in made.items()}


def _good(target: str) -> Callable[[Path], bytes]:
    return lambda folder: "".join(f"{BEGINS}{name}\n{text}" for name, text in files(target).items()).encode()


@cache
def _poses() -> tuple[Array, Array]:
    one = machine()
    position, direction = np.zeros((3, len(one.axes))), np.zeros((3, len(one.axes)))
    for column, axis in enumerate(one.axes):
        low, high = axis.travel or (-3.0, 3.0)
        position[:, column] = low, 0.4 * low + 0.6 * high, high
        direction[:, column] = 1, -1, 1
    return position, direction


def _read(target: str) -> Callable[[Path], Any]:
    """→ what reads the files of a target as its simulated control does, and where that one then sends the motors."""

    def read(folder: Path) -> Any:
        place = folder / target
        place.mkdir(exist_ok=True)
        for name in files(target):
            (place / name).unlink(missing_ok=True)
        (place / "compensation.json").write_text(json.dumps({"target": target}), encoding="utf-8")
        data = (folder / f"{target}.txt").read_bytes()
        for name, text in re.findall(rb"(?:^|\n)@@@ ([\w.-]+)\n(.*?)(?=\n@@@ |\Z)", data, re.DOTALL):
            if name.decode("ascii", "replace") in files(target):
                (place / name.decode("ascii")).write_bytes(text)
        return compensation.read(place, machine())(*_poses())

    return read


TABLES = {f"control-{name}": Reader(f"{name}.txt", _good(name), _read(name)) for name in compensation.targets()}
