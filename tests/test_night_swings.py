"""What swings with the temperature is no drift and no knock; a drift, or a knock, beside a temperature that swings is one."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.nights_parts import Event, Story, nights

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.swings import swing
from tango_cnc.nightly.words import value
from tango_cnc.report.faults import faults
from tango_cnc.report.plain import plain
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say

DAYS = 20


def series(
    seed: int, rate: float = 2.0, drift: float = 0.0, knock: float = 0.0, season: float = 0.0
) -> list[tuple[float, float, float]]:
    """→ (day, °C, mm) of nights, oldest first, in a shop as it is: µm/K, µm a day, µm on the tenth night."""
    rng = np.random.default_rng(seed)
    day = np.arange(DAYS, dtype=float)
    warm = 20 + 1.2 * np.sin(day + rng.uniform(0, 6)) + rng.normal(0, 0.3, DAYS)
    warm = 20 + 0.15 * (warm - 20) + season * day if season else warm
    own = rate * (warm - 20) + drift * day + knock * (day >= 10) + np.cumsum(rng.normal(0, 0.1, DAYS)) + rng.normal(0, 0.25, DAYS)
    return [(float(d), float(c), float(v) / 1e3) for d, c, v in zip(day, warm, own, strict=True)]


def named(**what: float) -> list[bool]:
    return [swing("EY0C", "mm", series(seed, **what)[::-1]) is not None for seed in range(200)]


def test_what_follows_the_temperature_is_said_to_do_so_with_its_interval() -> None:
    assert np.mean(named()) > 0.95
    found = [s for seed in range(200) if (s := swing("EY0C", "mm", series(seed)[::-1])) is not None]
    off = [(s.per_kelvin - 2e-3) / s.std for s in found]
    assert np.mean(np.abs(off) < 2) > 0.9 and np.mean([s.std for s in found]) < 0.15e-3


@pytest.mark.parametrize(
    "what",
    [
        {"drift": 0.3},
        {"drift": -0.2},
        {"knock": 6.0},
        {"rate": 0.0, "drift": 0.2},
        {"rate": 0.0},
        {"rate": 0.0, "drift": 0.3, "season": 0.4},
    ],
)
def test_a_drift_or_a_knock_beside_a_temperature_that_swings_stays_one(what: dict[str, float]) -> None:
    assert np.mean(named(**what)) < 0.03


@pytest.mark.few(0)
@pytest.mark.parametrize("drift", [False, True])
def test_an_alarm_of_what_swings_is_no_drift_of_a_bearing(root: Path, tmp_path: Path, drift: bool) -> None:
    """It drifted, stood still since the day it began, came back by somebody, and had its bearing looked at today."""
    cell, truth = read_cell(root / "examples" / "hu40t"), read_world(root / "examples" / "hu40t" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::4]))
    at = [0.0, *(2.0 * math.sin(1 + n / 2.6) for n in range(13))]  # a warm day, then no step that is an alarm by itself
    events = [Event(n + 1, warmer=at[n] - at[n - 1]) for n in range(1, 14)]
    events += [Event(4, drift={"EX0C": 2.5e-3})] if drift else []
    with opened(tmp_path / "history.db") as history:
        story = Story(tuple(events), {"EX0C": 3.5e-3}, 0.1)
        records = [r for r, _ in nights(cell, truth, history, 14, 2, story, Nightly(diagnose=False, check_minutes=2))]
    last = records[-1]
    told = [a for a in [*last["alarms"], *last.get("standing", ())] if a["parameter"] == "EX0C"]
    text = " ".join(message(last, (), ())[1].split())
    page = " ".join(f"{x['text']} {x['todo']} {x['whole']}" for x in faults(last, last.get("standing", ()), {}, Units(), texts()))
    if drift:
        assert told and not any("swing" in a for a in told) and "swings" not in text
        assert any(a["rate_per_day"] for a in told)
        return
    assert told and all("swing" in a for a in told if a in last["standing"]), last["headline"]
    assert told[0]["swing"]["per_kelvin"] == pytest.approx(3.5e-3, abs=4 * told[0]["swing"]["std"]) and not told[0]["rate_per_day"]
    assert "it swings with the temperature, by +3." in text and "bearing" not in text and "stood still" not in text
    assert "Enter no new location" not in text and "bearing" not in page
    assert "Correct the whole error" not in page and "by +3.5 µm/K over" in page, page
    for r in records[8:]:
        assert not r["alarms"] and all("swings with the temperature" in r["trend"]["text"] for _ in (1,) if r.get("trend"))


def test_a_page_rounds_what_is_said_for_every_kelvin() -> None:
    """By +1.9261721940 ± 0.1236343258 µm/K."""
    text = say("night.sensors.swings", text="x", name="EY0C", rate=value(1.926172194e-3, "mm/K", 1.236343258e-4), count=12)
    assert "by +1.9 µm/K over 12 nights" in plain(text, Units(), texts())
    tilted = say("night.sensors.swings", text="x", name="EA0C", rate=value(-1.926172194e-6, "rad/K", 1.2e-7), count=12)
    assert "by −1.9 µrad/K over" in plain(tilted, Units(), texts())
