"""Where the axes turn: what is said where nothing takes the probe clear names the indexation as people count it."""

from __future__ import annotations

import pytest
from support.blockcell import block, cell, machine

from tango_cnc.plan import plan
from tango_cnc.records import InputError


def test_where_no_lift_takes_the_probe_clear_the_indexation_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is lifted at all here, so the probe stays within what the table sweeps."""
    monkeypatch.setattr("tango_cnc.plan.clearance.TRIES", 0)
    with pytest.raises(InputError, match=r"indexation 1 \(.*no lift takes the probe clear of what the rotary axes sweep"):
        plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 30, "C": 40}]), "leave-out")
