"""The cap on changes: what a number of the ISO 230-1 file does at most over the volume, as a length or an angle."""

from __future__ import annotations

import re

import pytest
from support.compensated import ROOT, proposed

from tango_cnc.compensate.proposal import beyond
from tango_cnc.compensate.targets import Request, iso230
from tango_cnc.files import read_cell
from tango_cnc.terms import find

LIMITS = {"X": (-150.0, 100.0), "Y": (-80.0, 120.0), "Z": (0.0, 200.0), "A": (-0.5, 1.5), "C": (-3.0, 3.0)}


def reach(name: str) -> float:
    """name of a coefficient of the trunnion machine → the most that it is multiplied by."""
    machine = read_cell(ROOT / "examples" / "trunnion").machine
    (held,) = iso230.held(Request(machine, LIMITS, {"digits": 9}, tuple(find(name, machine))))
    assert held.reach is not None
    return held.reach


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("name", "most"),
    [("EXA1", 1.5), ("EXC2", 9.0), ("EBX1", 150.0), ("EYX2", 150.0**2), ("EXX1", 150.0), ("EXXb", 1.0), ("EC0A", 1.0)],
)
def test_a_coefficient_is_multiplied_by_its_own_axis(name: str, most: float) -> None:
    assert reach(name) == pytest.approx(most, rel=0.1)


@pytest.mark.long
def test_a_gain_of_x_counts_over_the_way_of_x() -> None:
    proposal = proposed("trunnion", "iso230")
    change = next(abs(float(c)) for h, c in zip(proposal.held, proposal.fit.change, strict=True) if h.place == "EXX1")
    way = max(abs(v) for v in proposal.request.limits["X"])
    (said,) = (text for text in beyond(proposal, 1e-12, 1e-12) if text.startswith("EXX1"))
    assert "mm over the volume" in said
    assert float(re.findall(r"changes by (\S+)", said)[0]) == pytest.approx(change * way, rel=0.05)
