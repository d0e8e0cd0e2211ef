"""A program that reads ISO 230-1 errors from YAML and moves the linear axes so that the tip is where it was meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tango_cnc.files.checked import load
from tango_cnc.records import Array, Machine

from ..coefficients import coefficient
from . import Applied


def read(folder: Path, machine: Machine) -> Applied:
    """folder, machine → the correction. Raises InputError for names and values that are none."""
    root = load(folder / "iso230.yaml")
    fields = dict(root.items())
    values: dict[str, float] = {}
    for name, node in fields["errors"].items():
        parts = node.fields(["value", "unit"])
        coefficient(name, machine)
        values[name] = parts["value"].number(-1000, 1000)

    def at(positions: Array, directions: Array) -> dict[str, Array]:
        return {name: np.full(len(positions), value) for name, value in values.items()}

    return Applied(machine, None, at)
