"""A knock in a night in which the machine is warmer is a knock: so few kelvins do not do that, as far as it has shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc import state as s
from tango_cnc.files import read_cell, read_world
from tango_cnc.nightly import parts
from tango_cnc.nightly.sensors import how_warm
from tango_cnc.records import Cell, Readings, World
from tango_cnc.report.tonight import by_verdict
from tango_cnc.texts import say
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
        self, state: s.State, celsius: float, rates: Mapping[str, float], knock: Mapping[str, float], every: int
    ) -> tuple[s.Named, s.State, s.State]:
        """→ what the night is called, the state before it, and after it."""
        ahead = s.predicted(state, state.day + 1)
        what = s.seen(self.followed, self.read(17, celsius, rates, knock, every), ahead.mean, 20.0)
        tonight = s.judge(ahead, what)
        found = s.name_change(ahead, self.followed, tonight, s.hypotheses(self.followed, celsius - 20.0))
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
    beyond = by_verdict(either, "out_of_limits")["do"]
    assert beyond.startswith("Ask first who") and "Make parts" not in beyond and "usual temperature and measure it again" in beyond
