"""The compensation table in the control is wrong: a positioning error that is straight between the nodes of that table."""

from __future__ import annotations

import itertools

import numpy as np

from tango_cnc.records import InputError

from . import Disturbance, History
from ._kinds import AnyAxis, Numbers
from ._parts import in_units_of, positioning

EXAMPLE = {"axis": "X", "nodes": [-200, 0, 200], "values": [0, 0.003, -0.001]}


def disturb(history: History, rng: np.random.Generator, *, axis: AnyAxis, nodes: Numbers, values: Numbers) -> Disturbance:
    """n touches → positioning error through `values` (mm; rad) at `nodes` (mm; deg), straight between, constant beyond.

    Raises InputError when the nodes do not rise or are not as many as the values.
    """
    if len(nodes) < 2 or any(a >= b for a, b in itertools.pairwise(nodes)):
        raise InputError(f"nodes: found {list(nodes)}; allowed: two or more, each greater than the one before")
    if len(values) != len(nodes):
        raise InputError(f"values: found {len(values)} for {len(nodes)} nodes; allowed: as many values as nodes")
    at = [in_units_of(history, axis, node) for node in nodes]
    return Disturbance(errors={positioning(axis): np.interp(history.position[:, history.column(axis)], at, values)})
