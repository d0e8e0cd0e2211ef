"""The slow move that proves the probe alive, as a measuring move of a touch that nobody records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from tango_cnc.gate import BEHIND, gate
from tango_cnc.records import Approach

from ._base import Job, Leg, of_approach


def on_facet(job: Job) -> Job:
    """job → the same with the short search that proves the probe at a facet as the measuring move."""
    approach = job.plan.strategy.approach
    return replace(job, plan=of_approach(job.plan, Approach(approach.standoff, min(BEHIND, approach.search), approach.feed)))


def proving(job: Job) -> Job:
    """job → the same with the move of the gate as the measuring one; the slow one has half before and half behind the contact."""
    if job.options["gate"] == "facet":
        return on_facet(job)
    up = gate(job.plan)
    half = math.dist(up.start, up.end) / 2
    return replace(job, plan=of_approach(job.plan, Approach(half, half, up.feed)))


def leg(job: Job, came: Mapping[str, float]) -> Leg:
    """job, where every axis stands → the slow move of the gate as the measuring move of a touch that nobody records."""
    names, up, first = job.machine.names, gate(job.plan), job.plan.touches[0]
    target = {name: up.end[job.machine.column(name)] for name in job.machine.linear}
    touch = replace(
        first, standoff=up.start, contact=up.end, end=up.end, over=up.start, enter=None, leave=None
    )  # contact: the way there
    assert set(names) <= {*came, "S"}
    return Leg("gate", target, {**came, **target}, touch, came)
