"""A parameter that goes one way night after night, however fast machines are thought to wander."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tango_cnc.nightly import creep, trend
from tango_cnc.records import Array

NAMES = [f"P{i}" for i in range(20)]
STD = 1e-4  # mm


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Any:
    """(nights, 20) values oldest first, nights with an alarm about P0 → name of the parameter that is told, or None."""
    monkeypatch.setattr(creep, "drift_of", lambda k, i, *_, alarms: None if alarms else k.followed.names[i])
    followed = SimpleNamespace(machine=range(20), names=NAMES, selection=SimpleNamespace(label=lambda name: name))
    known = SimpleNamespace(followed=followed, labels=NAMES, worst=lambda moved: 1e3 * float(np.abs(moved).max()))

    def of(values: Array, alarms: tuple[int, ...] = ()) -> str | None:
        records = [
            {
                "parameters": {n: {"value": v, "std": STD} for n, v in zip(NAMES, row, strict=True)},
                "state": {"day": float(i)},
                "alarms": [{"parameter": "P0"}] if i in alarms else [],
            }
            for i, row in enumerate(values[:-1])
        ]
        after = SimpleNamespace(mean=values[-1], std=np.full(20, STD), day=float(len(records)), rates=np.full(20, 1e-9))
        return creep.creeping(known, records[::-1], after)  # type: ignore[arg-type, return-value]

    return of


@pytest.mark.long
def test_what_wanders_is_no_drift(said: Any) -> None:
    rng = np.random.default_rng(3)
    walks = np.cumsum(rng.normal(0, 6e-4, (120, 21, 20)), axis=1)
    assert sum(said(walk) is not None for walk in walks) <= 2  # 1 in 1000 is stated


@pytest.mark.long
def test_four_tenths_of_a_micrometre_a_night_are_told_within_ten_nights(said: Any) -> None:
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(40):
        walk = np.cumsum(rng.normal(0, 1e-4, (11, 20)), axis=0)
        walk[:, 7] += 4e-4 * np.arange(11)
        found += said(walk) == "P7"
    assert found > 36


def test_it_looks_back_to_the_last_alarm_about_that_parameter_only(said: Any) -> None:
    values = np.tile(1e-6 * np.arange(12)[:, None] ** 0.5, (1, 20))
    values[:, 0] = 5e-4 * np.arange(12) + 1e-5 * np.sin(np.arange(12))
    assert said(values) == "P0"
    assert said(values, alarms=(2,)) == "P0"
    assert said(values, alarms=(9,)) is None  # two nights since: told then


def test_what_does_less_than_two_micrometres_is_for_the_table(said: Any) -> None:
    values = np.random.default_rng(5).normal(0, 1e-6, (9, 20))
    values[:, 7] += 2e-4 * np.arange(9)
    assert said(values) is None


def test_a_plain_change_is_said_while_nobody_knows_how_far_the_machine_wanders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trend, "drift_of", lambda k, i, *_, alarms=True: None if alarms else k.followed.names[i])
    followed = SimpleNamespace(machine=range(20), names=NAMES, wander=np.full(20, 1e-6), selection=SimpleNamespace(label=str))
    known = SimpleNamespace(followed=followed, labels=NAMES, worst=lambda moved: 1e3 * float(np.abs(moved).max()))
    tonight = np.zeros(20)
    tonight[3] = 18 * STD

    def said(learned: int) -> object:
        last = {
            "parameters": {n: {"value": 0.0, "std": STD} for n in NAMES},
            "state": {"day": 0.0, "rates": [1e-6], "learned": learned},
            "alarms": [],
        }
        return trend.drift(known, [last], SimpleNamespace(mean=tonight, std=np.full(20, STD), day=1.0), 1.0)  # type: ignore[arg-type]

    assert said(learned=0) == "P3"
    assert said(learned=20) is None
