"""`tolerances` of machine.yaml and artefact.yaml ↔ numbers: what is known before anything is measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields

from ..judgement import TableTolerances, Tolerances
from .checked import FURTHEST, Node

DEGREE = math.pi / 180
MICRO = 1e-6
# key of the file → factor from the unit of the file (mm, deg, µm/m) to that of the record
TOLERANCES = {
    "location": 1.0,
    "angle": DEGREE,
    "scale": MICRO,
    "motion": 1.0,
    "motion_angle": DEGREE,
    "backlash": 1.0,
    "backlash_angle": DEGREE,
    "stylus": 1.0,
    "scatter": 1.0,
    "direction": 1.0,
    "step": 1.0,
    "runout": 1.0,
}
TABLE_TOLERANCES = {"facet": 1.0, "common": 1.0, "ball": 1.0, "placement": 1.0, "placement_angle": DEGREE}


def read_tolerances(node: Node | None, units: Mapping[str, float]) -> dict[str, float]:
    """mapping of a file or None, {key: its unit} → {key: mm, rad, mm/mm} of those that are given.

    Raises InputError for unknown keys and for what is not greater than 0.
    """
    if node is None:
        return {}
    return {key: child.number(above=0, high=FURTHEST) * units[key] for key, child in node.fields([], list(units)).items()}


def tolerances_given(record: Tolerances | TableTolerances) -> dict[str, float]:
    """tolerances → {key: mm, deg, µm/m} of those that differ from the defaults, as a file has them."""
    units = TOLERANCES if isinstance(record, Tolerances) else TABLE_TOLERANCES
    usual = type(record)()
    values = {f.name: (getattr(record, f.name), getattr(usual, f.name)) for f in fields(record)}
    return {key: round(value / units[key], 12) for key, (value, default) in values.items() if value != default}
