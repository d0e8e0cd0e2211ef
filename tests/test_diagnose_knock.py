"""A knock of the stylus, of an axis on what carries it, of everything; a tip that wears. Where two read alike, both are listed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.diagnose.words import as_text
from tango_cnc.estimate import estimate
from tango_cnc.noise import honest

KNOCKS = {"step", "stylus_knock", "axis_knock"}


def told(**effect: Any) -> Diagnosis:
    b = blind.bench()
    world = replace(b.world, effects=({"amplitude": 0.012, **effect},), noise=blind.NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=5)
    return diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms)


def listed(d: Diagnosis) -> set[str]:
    """→ what is named, and what would do as well."""
    return {f.cause for f in d.findings} | {name for f in d.findings for name, _, _ in f.alternatives}


def test_its_numbers_are_a_direction() -> None:
    machine = blind.bench().cell.machine
    for cause, setting in (("stylus_knock", {"at": 100}), ("axis_knock", {"axis": "C", "at": 100})):
        (effect,) = terms.effects(cause, machine, setting, np.array([3e-3, 0.0, -4e-3]))
        assert (effect["cause"], effect["amplitude"], effect["at"]) == (cause, pytest.approx(5e-3), 100)
        assert effect["direction"] == pytest.approx([0.6, 0.0, -0.8])


def test_only_an_axis_that_another_one_carries_can_be_pushed_on_it() -> None:
    assert blind.bench().cell.machine.carried == ("C",)


@pytest.mark.long
@pytest.mark.parametrize("cause", [{"cause": "stylus_knock"}, {"cause": "axis_knock", "axis": "C"}, {"cause": "step"}])
@pytest.mark.parametrize(("direction", "at"), [([1.0, 0.0, 0.0], 200), ([0.6, -0.8, 0.0], 130)])
def test_what_was_knocked_is_named_or_listed_and_nothing_else_is_explained(
    cause: dict[str, Any], direction: list[float], at: int
) -> None:
    d = told(**cause, direction=direction, at=at)
    named = [f.cause for f in d.findings]
    assert cause["cause"] in listed(d), named
    assert set(named) <= KNOCKS and len(named) == 1, named
    assert named == [cause["cause"]] or d.verdict == "unexplained", named
    first, last = d.findings[0].detail["at_after"], d.findings[0].detail["at"]
    assert first < at <= last, "the moment lies between two touches that tell it"


@pytest.mark.long
def test_a_moment_that_touches_do_not_feel_is_told_as_two_touches() -> None:
    """Along X of the spindle: no touch on a facet that looks up feels it."""
    d = told(cause="stylus_knock", direction=[1.0, 0.0, 0.0], at=203)
    (f,) = d.findings
    assert f.detail["at_after"] < 203 <= f.detail["at"]
    assert f.detail["at_after"] + 1 == f.detail["at"] or f"between touches {f.detail['at_after']} and {f.detail['at']}" in as_text(
        d
    )


@pytest.mark.long
@pytest.mark.parametrize("amplitude", [-0.006, 0.006])
def test_a_tip_that_wears_is_no_table_that_grows(amplitude: float) -> None:
    d = told(cause="tip_wear", tau=1500.0, amplitude=amplitude)
    assert [f.cause for f in d.findings] == ["tip_wear"], [(f.cause, f.alternatives) for f in d.findings]
    assert ("late" if amplitude < 0 else "early") in as_text(d)


@pytest.mark.long
def test_an_estimate_tells_everything_that_may_have_moved() -> None:
    b = blind.bench()
    cell = b.cell
    knocks = (
        ({"cause": "stylus_knock"}, "spindle"),
        ({"cause": "axis_knock", "axis": "C"}, "axis"),
        ({"cause": "step"}, "machine"),
    )
    for cause, may in knocks:
        effect = {"amplitude": 0.012, "direction": [1.0, 0.0, 0.0], "at": 200, **cause}
        read = simulate(cell.machine, cell.artefact, cell.strategy, replace(b.world, effects=(effect,), noise=blind.NOISE), seed=7)
        noise = honest(estimate(cell.machine, cell.artefact, read, cell.terms, 3)).noise
        assert noise is not None and noise.step is not None
        told = [(noise.step.frame, noise.step.axis), *noise.step.instead]
        assert may in [frame for frame, _ in told], (cause, told)
        assert len(set(told)) == len(told)


@pytest.mark.long
def test_what_the_wrong_one_of_two_knocks_leaves_gets_no_name() -> None:
    """3 µm of C on its cradle were a `step` and a `moving_mass` that followed what the step left."""
    b = blind.bench()
    tried = blind.trial(b, blind.eyes(b), ("axis_knock",), (0.003, 0.003), 28310047)
    assert tried is not None
    d = tried[1]
    assert {f.cause for f in d.findings} <= KNOCKS and "axis_knock" in listed(d)
    assert [f.cause for f in d.findings] == ["axis_knock"] or d.verdict == "unexplained"
