"""A knock in a night in which the machine is warmer is a knock: so few kelvins do not do that, as far as it has shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import nights

from sim_controller.simulate import simulate
from tango_cnc import state as s
from tango_cnc.files import read_cell, read_world
from tango_cnc.nightly import parts
from tango_cnc.nightly.dates import Since
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.sensors import how_warm
from tango_cnc.nightly.warmth import as_early_as, rates_shown
from tango_cnc.nightly.words import changed
from tango_cnc.records import Cell, Readings, World
from tango_cnc.report.tonight import by_verdict
from tango_cnc.texts import say
from tango_cnc.texts.number import shown
from tango_cnc.touches import from_readings

SWINGS = {"EX0C": 6e-4, "EX0S": 6e-4, "EXX1": 1.5e-6, "EYY1": 1.5e-6, "EZZ1": 1.5e-6}  # a K
ELSEWHERE = {"EX0S": 5e-4, "EA0B": 1e-6, "EXX1": 2e-6, "EZZ1": -2e-6}  # a K, beside them: heated in another place than before
EVERY = 4  # indexations of a check


class Shop:
    """A machine with a bed sensor: what is followed, and what its touches say at any temperature."""

    def __init__(self, root: Path) -> None:
        self.cell: Cell = read_cell(root / "examples" / "hu40t")
        self.truth: World = read_world(root / "examples" / "hu40t" / "world.yaml")
        readings = self.read(3, 20.0, {}, {}, 1)
        self.followed = s.frame(from_readings(self.cell.machine, self.cell.artefact, readings), self.cell.terms)
        begin = after = s.start(self.followed, 0.0, 20.0)
        for _ in range(3):
            what = s.seen(self.followed, readings, after.mean, 20.0)
            after = s.updated(begin, what, s.judge(begin, what), quiet=False)
        self.first = after
        state = s.reopened(after, self.followed, None, temperature=True)
        for night, celsius in enumerate((23.0, 17.5, 21.0, 16.0), 4):
            what = s.seen(self.followed, self.read(night, celsius, SWINGS, {}, 1), state.mean, 20.0)
            state = s.updated(s.predicted(state, state.day + 1), what, s.judge(state, what))
        self.learned = state

    def read(self, seed: int, celsius: float, rates: Mapping[str, float], knock: Mapping[str, float], every: int) -> Readings:
        moved = {n: rates.get(n, 0.0) * (celsius - 20.0) + knock.get(n, 0.0) for n in {*rates, *knock}}
        errors = {n: self.truth.errors.get(n, 0.0) + moved.get(n, 0.0) for n in {*self.truth.errors, *moved}}
        strategy = replace(self.cell.strategy, indexations=self.cell.strategy.indexations[::every])
        found = simulate(self.cell.machine, self.cell.artefact, strategy, replace(self.truth, errors=errors), seed=seed)
        return replace(found, temperatures={"bed": np.full(len(found), celsius)})

    def named(
        self,
        state: s.State,
        celsius: float,
        rates: Mapping[str, float],
        knock: Mapping[str, float],
        every: int,
        shown: Mapping[str, tuple[float, float]] | None = None,
    ) -> tuple[s.Named, s.State, s.State]:
        """→ what the night is called, the state before it, and after it."""
        ahead = s.predicted(state, state.day + 1)
        what = s.seen(self.followed, self.read(17, celsius, rates, knock, every), ahead.mean, 20.0)
        tonight = s.judge(ahead, what)
        found = s.name_change(ahead, self.followed, tonight, s.hypotheses(self.followed, celsius - 20.0), (), shown)
        assert tonight.alarm() and found is not None
        return found, ahead, s.updated(parts.opened(ahead, self.followed, found), what, tonight, quiet=False)


@pytest.fixture(scope="module")
def shop(root: Path) -> Shop:
    return Shop(root)


@pytest.mark.few(3)
@pytest.mark.parametrize("every", [1, EVERY])
@pytest.mark.parametrize("kelvin", [-3.0, 3.0])
@pytest.mark.parametrize("size", [0.020, 0.008])
def test_a_knock_in_a_warmer_night_is_a_knock(shop: Shop, size: float, kelvin: float, every: int) -> None:
    """20 µm in a night of 3 K were "the machine is warmer", and no later quiet night was right again."""
    rates = {n: SWINGS.get(n, 0.0) + ELSEWHERE.get(n, 0.0) for n in {*SWINGS, *ELSEWHERE}}
    found, ahead, after = shop.named(shop.learned, 20.0 + kelvin, rates, {"EX0C": size}, every)
    assert (found.hypothesis.cause, found.hypothesis.parameter) == ("axis_location", "EX0C")
    assert found.size[0] == pytest.approx(size, abs=0.0015)
    base = len(shop.followed.model.names)
    per_kelvin = slice(base, base + len(shop.followed.warm))
    place = base + [shop.followed.names[i] for i in shop.followed.warm].index("EX0C")
    assert abs(after.mean[place] - ahead.mean[place]) < 1.5e-4  # mm/K: what it does for each K is as it was
    assert np.all(after.std[per_kelvin] <= ahead.std[per_kelvin] * 1.001 + 1e-6)


@pytest.mark.few(1)
@pytest.mark.parametrize("every", [1, EVERY])
@pytest.mark.parametrize("kelvin", [-3.0, 3.0])
def test_a_knock_in_the_first_warm_night_of_all_is_named(shop: Shop, kelvin: float, every: int) -> None:
    """Nothing is known yet of what a kelvin does: 6.7 µm of one error are no temperature, 2.7 may be either."""
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, SWINGS, {"EX0C": 0.020}, every)
    assert found.hypothesis.parameter == "EX0C" and "temperature" in found.instead
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, SWINGS, {"EX0C": 0.008}, every)
    assert found.hypothesis.cause == "temperature" and found.instead == ("EX0C",)


@pytest.fixture(scope="module")
def still(shop: Shop) -> dict[str, tuple[float, float]]:
    """What seven nights of ±0.4 K show of a machine before any alarm: each error for each K, roughly."""
    rough = {"mm": 3e-4, "rad": 3e-7}
    followed = shop.followed
    labels = {followed.selection.label(followed.names[i]): followed.units[i] for i in followed.warm}
    return {name: (SWINGS.get(name, 0.0), rough.get(unit, 1e-6)) for name, unit in labels.items()}


@pytest.mark.few(2)
@pytest.mark.parametrize("every", [1, EVERY])
@pytest.mark.parametrize(("kelvin", "size"), [(-3.0, 0.008), (-2.5, -0.009), (3.5, 0.010), (3.0, 0.008)])
def test_nights_without_an_alarm_show_what_a_kelvin_does(
    shop: Shop, still: dict[str, tuple[float, float]], kelvin: float, size: float, every: int
) -> None:
    """8 to 13 µm at 2.5 to 3.5 K of a machine that had shown 0.6 µm/K were "the machine is warmer", up to 5 µm/K."""
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, SWINGS, {"EX0C": size}, every, still)
    assert (found.hypothesis.cause, found.hypothesis.parameter) == ("axis_location", "EX0C")
    assert "temperature" in found.instead and found.size[0] == pytest.approx(size + 6e-4 * kelvin, abs=0.0015)


@pytest.mark.few(1)
@pytest.mark.parametrize("every", [1, EVERY])
@pytest.mark.parametrize("kelvin", [-2.5, 3.5])
def test_two_knocks_in_a_warmer_night_are_both_named(
    shop: Shop, still: dict[str, tuple[float, float]], kelvin: float, every: int
) -> None:
    """13 and 10 µm: the second one was taken for what the temperature did beside the first."""
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, SWINGS, {"EY0S": 0.013, "EX0C": 0.010}, every, still)
    sizes = {one.hypothesis.parameter: float(one.size[0]) for one in found.all}
    assert sizes["EY0S"] == pytest.approx(0.013, abs=0.001) and sizes["EX0C"] == pytest.approx(0.010 + 6e-4 * kelvin, abs=0.001)


@pytest.mark.parametrize("kelvin", [-3.0, 4.0])
def test_a_machine_that_does_what_its_nights_have_shown_is_warmer(
    shop: Shop, still: dict[str, tuple[float, float]], kelvin: float
) -> None:
    rates = {"EX0C": 2.4e-3, "EX0S": 2e-3, "EXX1": 5e-6, "EYY1": 5e-6, "EZZ1": 5e-6}
    shown = still | {name: (rate, 4e-4 if name.endswith(("C", "S")) else 1e-6) for name, rate in rates.items()}
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, rates, {}, 1, shown)
    assert found.hypothesis.cause == "temperature"


def test_what_a_kelvin_does_is_known_as_well_as_the_nights_that_show_it() -> None:
    def record(number: int, celsius: float, micrometres: float) -> dict[str, Any]:
        own = {"value": micrometres * 1e-3, "unit": "mm", "std": 2e-4}
        warm = {"bed": {"mean": celsius, "first": celsius, "last": celsius}}
        return dict(night=f"2026-11-{number:02d}", parameters={"EX0C": own}, temperatures=warm)

    kelvin = (0.3, -0.4, 0.1, 0.5, -0.2, 0.0, -0.3)
    rate, std = rates_shown([record(9 - i, 20 + k, 0.6 * k) for i, k in enumerate(kelvin)])["EX0C"]
    width = float(np.sqrt(np.sum((np.array(kelvin) - np.mean(kelvin)) ** 2)))
    assert rate == pytest.approx(6e-4) and std == pytest.approx(2e-4 / width)  # no better than each night knows it
    assert rates_shown([record(9 - i, 20.0, 0.1 * i) for i in range(7)]) == {}  # of a hall that stands still
    assert rates_shown([record(9 - i, 20 + k, 0.6 * k) for i, k in enumerate(kelvin[:4])]) == {}


@pytest.mark.parametrize("kelvin", [-3.0, 3.0])
def test_a_machine_that_swings_in_all_its_errors_is_warmer(shop: Shop, kelvin: float) -> None:
    units = {shop.followed.names[i]: shop.followed.units[i] for i in shop.followed.warm}
    rates = {n: {"mm": 3e-3, "rad": 3e-6}.get(unit, 5e-6) for n, unit in units.items() if not n.endswith("b")}
    found, _, _ = shop.named(shop.first, 20.0 + kelvin, rates, {}, 1)
    assert found.hypothesis.cause == "temperature" and found.besides is None and not found.instead


def test_one_night_does_not_determine_anew_what_a_machine_has_shown_for_each_kelvin(shop: Shop) -> None:
    base = len(shop.followed.model.names)
    own = slice(base, base + len(shop.followed.warm))
    never, again = (s.reopened(state, shop.followed, None, temperature=True).std[own] for state in (shop.first, shop.learned))
    length = [j for j, i in enumerate(shop.followed.warm) if shop.followed.units[i] == "mm"]
    assert np.all(never[length] > 2.9e-3) and np.all(again[length] < 1.5e-3)


def test_who_was_at_the_machine_is_asked_first_where_a_knock_may_be_all_of_it() -> None:
    alarm = {"cause": "temperature", "text": say("changed.unknown", size="9 µm"), "do": say("cause.temperature.do"), "size": 0.009}
    before = [{"night": "2026-10-18", "temperatures": {"bed": {"mean": 20.0, "first": 20.0, "last": 20.0}}}]
    either, warm = (how_warm(alarm | {"instead": x}, {"bed": {"state": "heard"}}, 23.0, before) for x in (["EX0C"], []))
    assert either["do"].startswith(
        "Ask first who was at the machine: a knock (EX0C) may be all of it. Where nobody was: Make parts"
    )
    assert warm["do"] == alarm["do"]
    assert either["text"].endswith("; or a knock has moved it (EX0C)") and "knock" not in warm["text"]
    beyond = by_verdict(either, "out_of_limits")["do"]
    assert beyond.startswith("Ask first who") and "Make parts" not in beyond and "usual temperature and measure it again" in beyond


def test_a_knock_that_may_have_been_all_of_a_warm_night_dates_from_the_night_before_that() -> None:
    """EX0C −10 µm and +3.5 K; the hall was back a night later, and the knock was of that night, by its date and its parts."""

    def record(number: int, celsius: float) -> dict[str, Any]:
        return {"night": f"2026-03-{number:02d}", "temperatures": {"bed": {"mean": celsius, "first": celsius, "last": celsius}}}

    warm: dict[str, Any] = {"cause": "temperature", "since": "2026-03-08", "instead": ["EX0C"], "night": "2026-03-09"}
    warm |= {"warmer": {"then": 20.5, "kelvin": 3.0, "celsius": 23.5}}
    last = Since("2026-03-09", say("night.alarms.last_night"))
    text = changed("EX0C", "-11.0 ± 0.7 µm", last.words)
    moved = {"cause": "axis_location", "parameter": "EX0C", "since": last.date, "size": -0.011, "text": text}
    moved |= {"on_part": say("part.turned_since", axis="C", angle="180", effect="22.0 µm", since=last.date), "rate_per_day": None}
    (told,) = as_early_as([moved], [warm], [record(9, 23.5), record(8, 20.5)], last)
    assert told["since"] == "2026-03-08" and "since 2026-03-08" in told["text"] and "Since 2026-03-08" in told["on_part"]
    assert "; the night ending 2026-03-09 took it for temperature" in told["text"]
    later = Since("2026-03-11", say("night.alarms.last_night"))
    again = moved | {"since": later.date}
    sound = [record(11, 24.0), record(10, 20.4), record(9, 23.5)]  # the night of the 10th was as warm as before, and sound
    assert as_early_as([again], [warm], sound, later) == [again]
    for other in (moved | {"parameter": "EY0S"}, moved | {"undoes": {"alarm": "x"}}):
        assert as_early_as([other], [warm], [record(9, 23.5)], last) == [other]


@pytest.mark.few(0)
@pytest.mark.parametrize("meant", [["EX0C"], []])
def test_parts_to_check_are_named_where_a_warm_night_may_have_been_a_knock(meant: list[str]) -> None:
    alarm = nights.knock("2026-11-02") | {"cause": "temperature", "parameter": "temperature", "do": say("cause.temperature.do")}
    alarm |= {"instead": meant, "text": say("changed.temperature", size="9.0 µm"), "since": "2026-11-01"}
    before = [{"night": "2026-11-01", "temperatures": {"bed": {"mean": 20.0, "first": 20.0, "last": 20.0}}}]
    told = how_warm(alarm, {"bed": {"state": "heard"}}, 23.0, before)
    mail = " ".join(message(nights.night("M", 2, "changed", alarms=[told]), (), ())[1].split())
    assert ("parts to check: All that were made since 2026-11-01" in mail) == bool(meant)


@pytest.mark.parametrize(
    ("unit", "factor", "label"),
    [
        ("mm/K", 1e3, "µm/K"),
        ("rad/K", 1e6, "µrad/K"),
        ("mm/mm/K", 1e6, "µm/m/K"),
        ("rad/mm/K", 1e9, "µrad/m/K"),
        ("mm/mm²/K", 1e9, "µm/m²/K"),
    ],
)
def test_every_coefficient_has_a_unit_for_each_kelvin(unit: str, factor: float, label: str) -> None:
    """Scales that changed beside a knock ended the verdict of the night."""
    assert shown(unit) == (pytest.approx(factor), label)
