"""A strategy that never turns the spindle: its place and the runout of the stylus are one, and nobody is promised otherwise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.compensated import example, first, measured, text, truth, write
from support.trust_parts import judged

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from tango_cnc.compensate import as_json, loop, propose
from tango_cnc.compensate.contradicted import contradicted
from tango_cnc.compensate.outcome import promises
from tango_cnc.files import read_terms
from tango_cnc.records import World

SPINDLE = {"EX0S": 0.004, "EY0S": -0.008, "EX0C": 0.016}
STYLUS = {"EXt": 0.006, "EYt": -0.004}


def moved(world: World) -> World:
    """True machine → the same, whose spindle is elsewhere, with a stylus that runs out."""
    return replace(world, errors={**world.errors, **SPINDLE}, stylus={**world.stylus, **STYLUS})


@pytest.mark.few(1)
@pytest.mark.parametrize("spindle", [False, True])
def test_where_the_spindle_is_stays_in_the_promise(spindle: bool, tmp_path: Path) -> None:
    """13.9 µm were left of a promise of 0.47 (0.25 to 0.89)."""
    cell, world = example("huron")
    true = moved(world) if spindle else world
    proposal = propose(measured(cell, true, seed=7), "siemens", poses=256)
    record = as_json(proposal)
    promise = record["promise"]
    left = truth(cell, true, proposal, read(write(proposal, tmp_path), cell.machine))
    assert promise["rms_after_um"]["low"] <= left <= promise["rms_after_um"]["high"] < 40
    assert promise["rms_before_um"]["low"] <= truth(cell, true, proposal, None) <= promise["rms_before_um"]["high"]
    assert (left > 10) is spindle
    # A second run that does not turn S, either, is held against what such touches see.
    assert promises(record)[1].high < 1 and "the spindle was never turned" in text(proposal)


def test_a_spindle_that_was_turned_widens_nothing() -> None:
    proposal = propose(first("trunnion"), "siemens", poses=64)
    assert proposal.fit.widened is None and "seen_after_um" not in as_json(proposal)["promise"]


@pytest.mark.few(1)
@pytest.mark.parametrize("terms", [None, "S3"])
def test_estimate_says_whatever_the_terms_are_that_the_two_are_one(terms: str | None) -> None:
    cell, world = example("huron")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    _, judgement = judged(cell, readings, cell.terms if terms is None else read_terms(terms, cell.folder), 3)
    said = " ".join(map(str, judgement.remarks))
    assert "the spindle was never turned" in said and "S turned by 180°" in said


@pytest.mark.few(0)
@pytest.mark.parametrize("tcp", [True, False])
def test_readings_of_a_changed_machine_that_fit_the_other_word_far_better_are_asked_for(tcp: bool, tmp_path: Path) -> None:
    """The machine has changed by 8 µm, so neither word leaves what was promised; --tcp, which is wrong, leaves thrice as much."""
    cell, world = example("trunnion")
    (tmp_path / "tango.yaml").write_text("tango: 1\n")
    one = propose(first("trunnion"), "siemens")
    kept = loop.store(tmp_path, one, "2026-01-01T00:00:00Z")
    more = {"EX0C": 0.012, "EXX1": 15e-6, "EC0Y": 20e-6}
    errors = {**world.errors, **{name: world.errors.get(name, 0.0) + size for name, size in more.items()}}
    result = measured(cell, replace(world, errors=errors), read(kept.folder, cell.machine, tcp=False), seed=11)
    why = contradicted(kept, result, one.held, tcp=tcp)
    print(why)
    assert not why if not tcp else "far less" in why and "allowed: --no-tcp" in why
