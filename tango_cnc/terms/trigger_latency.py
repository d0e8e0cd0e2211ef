"""The control latches its position too late: the reading is off by feed × delay along the approach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early
from ._world import Effects


def variants(touches: Touches) -> Variants:
    """touches → the one pattern, where the feed is recorded and varies."""
    if np.isfinite(touches.feed).all() and np.ptp(touches.feed) > 0:
        yield {}


def make(machine: Machine) -> list[Coefficient]:
    """machine → delay in s: a late latch reads too deep, so the surface appears too far inside."""
    return [early("trigger_latency", lambda t: -np.nan_to_num(t.feed) / 60.0, "s")]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the delay (world.yaml)."""
    return [{"cause": "trigger_latency", "delay": float(values[0])}]


TERM = Cause(
    text="the control reads its position a moment after the probe has triggered",
    source="1 µm per ms at 60 mm/min; ISO 230-10:2022, annex A (feed dependence)",
    frame="probe",
    mistaken=("pretravel_anisotropy",),
    follows="feed",
    says="the control reads its position {delay} ms late, which is {size}",
    meaning="a matter of probe and control, not of parts; sizes change with the measuring feed",
    advice="always measure with the feed at which the probe was calibrated, or keep the term",
    refine={},
    variants=variants,
    make=make,
    effects=effects,
)
