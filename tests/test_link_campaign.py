"""Sessions of 60 touches with seeded faults: nothing is lost, nothing invented, nothing moves from an unsafe state.

The same conversations as over a cable, in memory and without waiting; the ledger of the simulated machine is the judge.
"""

from __future__ import annotations

import os

import pytest
from support.linkfaults import bus_session, cable_session, judged, patched, tape_session
from support.linkparts import FakeClock

SESSIONS = {"dnc": tape_session, "modbus": bus_session, "grbl": cable_session}
CAMPAIGN = int(os.environ.get("TANGO_SESSIONS", "5000"))


def sessions(kind, seeds, tmp_path, monkeypatch):
    """→ (sessions, resumed runs, lost, invented, unsafe) of all seeds."""
    clock = FakeClock()
    patched(monkeypatch, clock)
    resumed, totals, injected = 0, [0, 0, 0], 0
    for seed in seeds:
        folder = tmp_path / str(seed)
        ledger, again = SESSIONS[kind](seed, folder, monkeypatch, clock)
        resumed += again
        injected += ledger.injected.total()
        verdict = judged(folder, ledger)
        assert verdict == (0, 0, 0), f"seed {seed}: {verdict} lost, invented, unsafe; {ledger.unsafe}"
        totals = [a + b for a, b in zip(totals, verdict, strict=True)]
    print(
        f"\n{kind}, seeds {seeds[0]} to {seeds[-1]}: {len(seeds)} sessions, {injected} injected, {resumed} times resumed, "
        f"lost invented unsafe: {totals}"
    )
    assert injected > 0
    return resumed


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", SESSIONS)
def test_a_few_sessions_with_faults(kind, tmp_path, monkeypatch):
    assert sessions(kind, (1, 6) if kind == "modbus" else (1,), tmp_path, monkeypatch) > 0  # 6: the control runs the program


@pytest.mark.campaign
@pytest.mark.parametrize("kind", SESSIONS)
@pytest.mark.parametrize("part", range(5))
def test_five_hundred_sessions_with_faults(kind, part, tmp_path, monkeypatch):
    assert sessions(kind, range(100 + 34 * part, 134 + 34 * part), tmp_path, monkeypatch) > 20


@pytest.mark.campaign
@pytest.mark.parametrize("kind", SESSIONS)
@pytest.mark.parametrize("part", range(20))
def test_five_thousand_sessions_with_faults(kind, part, tmp_path, monkeypatch):
    many = -(-CAMPAIGN // (20 * len(SESSIONS)))
    assert sessions(kind, range(1000 + many * part, 1000 + many * (part + 1)), tmp_path, monkeypatch) > 0
