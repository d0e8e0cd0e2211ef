"""Parameters that are not to be trusted are neither written into a control nor prove that what was written helps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.compensated import example, first, text, truth, write
from support.trust_parts import judged

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from tango_cnc.compensate import Proposal, as_json, propose
from tango_cnc.compensate.loop import Kept
from tango_cnc.compensate.outcome import Outcome, Remeasured, ran
from tango_cnc.compensate.promise import Figure
from tango_cnc.compensate.trusted import as_far_as_trusted, kept_as_promised, worth_acting, wrong_by
from tango_cnc.records import TangoError


@cache
def proposed() -> Proposal:
    """→ what is proposed to a Siemens for the example trunnion."""
    return propose(first("trunnion"), "siemens", tcp=False)


@pytest.mark.long
def test_an_error_that_is_not_to_be_trusted_is_not_written() -> None:
    result = first("trunnion")
    proposal = proposed()
    by_size = sorted((s for s in proposal.fit.shares if s.word != "set-up"), key=lambda s: -s.effect_um)
    names = [result.selection.label(s.name) for s in by_size]
    worth_acting(proposal.fit, result, names[-3:], despite=False)  # the small ones do not hold the large ones up
    with pytest.raises(TangoError, match=rf"most of the error comes of {names[0]}, .* Nothing was written"):
        worth_acting(proposal.fit, result, names, despite=False)
    worth_acting(proposal.fit, result, names, despite=True)


@cache
def run() -> Remeasured:
    """→ what the same readings find over the volume of that proposal."""
    kept = Kept(1, Path("001-siemens"), as_json(proposed()))
    return ran(kept, first("trunnion"), list(proposed().held), tcp=True)


def said(verdict: str, untrusted: list[str] | None = None, hidden: Mapping[str, float] | None = None) -> Outcome:
    """verdict of a run, labels that it does not trust (default: all), {label: what no touch shows of it} → what is said of it."""
    result = first("trunnion")
    record = as_json(proposed())
    everything = [result.selection.label(c["name"]) for c in record["coefficients"]]
    found = Outcome(Figure(37, 36, 38), Figure(1, 0, 2), Figure(69, 68, 70), verdict, "69 are left of 37: load undo/")
    return as_far_as_trusted(found, record, result, everything if untrusted is None else untrusted, hidden or {}, run())


@pytest.mark.few(0)
@pytest.mark.parametrize("verdict", ["kept", "not as promised"])
def test_a_run_that_is_not_to_be_trusted_proves_nothing_good(verdict: str) -> None:
    assert said(verdict, []).verdict == verdict
    found = said(verdict)
    assert found.verdict == "undecided" and "decides nothing" in found.text


@pytest.mark.few(2)
@pytest.mark.parametrize(("part", "verdict"), [(0.1, "kept"), (0.4, "kept"), (0.6, "undecided"), (2.0, "undecided")])
def test_what_no_touch_shows_counts_against_what_was_there_before(part: float, verdict: str) -> None:
    """After a compensation that holds every value is near 0, and a drift of some µm is more than half of each."""
    result = first("trunnion")
    labels = {c.name: result.selection.label(c.name) for c in result.model.coefficients}
    hidden = {labels[c.name]: part * abs(float(v)) for c, v in zip(result.model.coefficients, result.values, strict=False)}
    assert said("kept", list(labels.values()), hidden).verdict == verdict


def test_what_seems_to_do_harm_is_taken_back_even_if_the_run_is_not_to_be_trusted() -> None:
    found = said("no help")
    assert found.verdict == "no help"
    assert found.text.startswith("69 are left of 37: load undo/. But ") and "take it back all the same" in found.text


@pytest.mark.long
def test_the_promise_contains_by_how_much_what_no_touch_shows_moves_a_center(tmp_path: Path) -> None:
    cell, world = example("trunnion")
    plain, unsure = (propose(first("trunnion"), "siemens", poses=256, hidden_by=by) for by in ({}, {"EY0C": 0.012}))
    assert unsure.numbers == plain.numbers and plain.fit.widened is None
    seen, promised = unsure.fit.rms_after, unsure.fit.promised.rms_after
    assert (seen.value, seen.low) == (promised.value, promised.low)
    there = replace(world, errors={**world.errors, "EY0C": world.errors["EY0C"] + 0.008})
    left = truth(cell, there, unsure, read(write(unsure, tmp_path / "c"), cell.machine))
    assert seen.high < left < promised.high < 10 * left
    assert "may move EY0C. Without that" in text(unsure) and "may move" not in text(plain)
    assert as_json(unsure)["promise"]["seen_after_um"]["high"] < as_json(unsure)["promise"]["rms_after_um"]["high"]


def test_a_backlash_that_may_have_the_wrong_sign_is_in_the_promise(tmp_path: Path) -> None:
    """dY with the other sign, 1 µm of backlash: 2.2 µm were left of a promise of 0.87 (0.47 to 1.93)."""
    cell, world = example("trunnion")
    world = replace(world, errors={**world.errors, "EYYb": 0.001})
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=7)
    signs = [-1.0 if name == "Y" else 1.0 for name in readings.axes]
    result, judgement = judged(cell, replace(readings, direction=readings.direction * signs), cell.terms, 3)
    assert judgement.verdict == "doubtful" and "EYYb" in judgement.untrusted
    doubts = wrong_by(result, judgement)
    made = propose(result, "siemens", poses=256, hidden_by=doubts)
    left = truth(cell, world, made, read(write(made, tmp_path / "c"), cell.machine))
    kept_as_promised(made.fit, result, {*judgement.untrusted} - {*dict(judgement.hidden)})  # too small to be refused
    assert made.fit.rms_after.high < left < made.fit.promised.rms_after.high < 3 * left
    assert "a mistake that was named, may move EYYb" in text(made)
    assert wrong_by(result, replace(judgement, verdict="trustworthy")) == dict(judgement.hidden)


@pytest.mark.long
@pytest.mark.parametrize("name", ["split", "trunnion"])
def test_a_proposal_says_what_a_scale_leaves_that_no_touch_shows(name: str, tmp_path: Path) -> None:
    cell, world = example(name)
    made = propose(first(name), "siemens", poses=256)
    assert ("every 10 µm/m of the absolute scale" in text(made)) is bool(made.common_scale) is (name == "split")
    assert ("rest on the length of the scale bar" in text(made)) is (made.bar is not None) is (name == "trunnion")
    if made.bar is not None:  # by 8 µm of 200 mm
        off = {a: world.errors.get(a, 0.0) + 40e-6 for a in ("EXX1", "EYY1", "EZZ1")}
        left = truth(cell, replace(world, errors={**world.errors, **off}), made, read(write(made, tmp_path / "b"), cell.machine))
        assert made.bar[0] == 0.5 and left == pytest.approx(8 * made.bar[1], rel=0.1) and left > made.fit.rms_after.high
    if made.common_scale:
        scaled = {a: world.errors.get(a, 0.0) + 1e-5 for a in ("EXX1", "EYY1", "EZZ1")}
        control = read(write(made, tmp_path / "c"), cell.machine)
        grown = truth(cell, replace(world, errors={**world.errors, **scaled}), made, control)
        assert grown > 2  # µm
        assert grown == pytest.approx(made.common_scale, rel=0.1, abs=truth(cell, world, made, control))
