"""Touches that do not fit are no bad luck when they belong together: a table that moved, a wrong bar, a chip, an angle, a sign."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.coverage import judged, pushed

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_readings_text, read_world, readings_text
from tango_cnc.judgement import Judgement
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, Readings


@pytest.fixture(scope="module")
def cell(root: Path) -> Cell:
    return read_cell(root / "examples" / "trunnion")


@pytest.fixture(scope="module")
def readings(cell: Cell, root: Path) -> Readings:
    return simulate(cell.machine, cell.artefact, cell.strategy, read_world(root / "examples/trunnion/world.yaml"), seed=11)


def only(judgement: Judgement, verdict: str) -> str:
    assert judgement.verdict == verdict
    return " ".join(judgement.reasons)


def moved(cell: Cell, readings: Readings, share: float, *by: float) -> Readings:
    """The table moves by mm in its own frame after this share of the touches."""
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    late = np.arange(len(readings)) >= round(share * len(readings))
    return pushed(cell, readings, late * (normal @ np.array(by)))


@pytest.mark.long
def test_a_table_that_moves_late_or_half_way_is_a_step(cell: Cell, readings: Readings) -> None:
    late = judged(cell, moved(cell, readings, 0.9, 0.035, 0.035, 0.0))
    assert re.search("something moved between touches 20[123] and 20[456]", only(late, "doubtful"))
    assert {"EX0S", "EY0S"} <= set(late.untrusted)  # the spindle is turned after it only
    half = judged(cell, moved(cell, readings, 0.5, 0.05, 0.0, 0.0))
    assert re.search("something moved between touches 11[123] and 11[456]", only(half, "doubtful"))


@pytest.mark.long
def test_a_table_that_was_bumped_and_turned_and_a_tip_that_was_changed_are_steps(cell: Cell, readings: Readings) -> None:
    point = np.array([cell.artefact.facets[f].point for f in readings.facet])
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    late = np.arange(len(readings)) >= 130
    turned = np.array([0.08, -0.05, 0.03]) + np.cross([2e-4, -1e-4, 5e-4], point)
    bumped = judged(cell, pushed(cell, readings, late * np.einsum("ij,ij->i", normal, turned)))
    reason = " ".join(bumped.reasons)
    assert re.search("something moved between touches 1(29|30) and 13[1-3]", reason) and "and it turned by A +19" in reason
    tip = " ".join(judged(cell, pushed(cell, readings, 0.04 * late)).reasons)
    assert re.search("something moved between touches 1(29|30) and 13[1-3]", tip)
    size = re.search(r"the tip is (\S+) µm larger in radius", tip)
    assert size and abs(float(size[1]) - 40.0) < 0.9, "known to 0.3 µm: ten draws lie between 39.8 and 40.7"


@pytest.mark.long
def test_a_bar_half_a_millimetre_too_long_is_named(cell: Cell, readings: Readings) -> None:
    bar = cell.artefact.scale_bar
    assert bar is not None
    wrong = replace(cell, artefact=replace(cell.artefact, scale_bar=replace(bar, length=bar.length + 0.5)))
    reason = only(judged(wrong, readings), "implausible")
    assert f"artefact.yaml states {bar.length + 0.5:g} mm: 0.50" in reason or f"{bar.length + 0.5:g} mm: 0.49" in reason


@pytest.mark.long
def test_a_tip_radius_that_only_the_balls_see_is_not_lulled(cell: Cell, readings: Readings) -> None:
    probe = replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + 0.25)
    reason = only(judged(replace(cell, machine=replace(cell.machine, probe=probe)), readings), "doubtful")
    assert "touches on ball 1 do not fit the others" in reason


@pytest.mark.long
def test_a_chip_and_an_angle_of_one_indexation_are_named(cell: Cell, readings: Readings) -> None:
    own = np.array([f == "5" for f in readings.facet]) & (np.arange(len(readings)) >= 110)
    assert "facet 5 is 30 µm elsewhere" in only(judged(cell, pushed(cell, readings, 0.03 * own)), "doubtful")
    position = np.array(readings.position)
    turned = np.abs(np.diff(position[:, [cell.machine.column(n) for n in ("A", "C")]], axis=0)).max(axis=1) > 1e-3
    eighth = np.concatenate([[0], np.cumsum(turned)]) == 8
    position[eighth, cell.machine.column("C")] += np.radians(1.0)
    first = int(readings.touch[np.flatnonzero(eighth)[0]])
    reason = only(judged(cell, replace(readings, position=position)), "doubtful")
    assert "C was 1.00" in reason and f"at touches {first} to" in reason


@pytest.mark.few(0)
def test_a_spindle_that_counts_the_other_way_is_named(cell: Cell, readings: Readings) -> None:
    position = np.array(readings.position)
    position[:, cell.machine.column("S")] *= -1
    judgement = judged(cell, replace(readings, position=position))
    assert "S has the other sign everywhere: it counts the other way" in only(judgement, "doubtful")
    assert {"EX0S", "EY0S"} <= set(judgement.untrusted)


def test_directions_that_lead_away_from_the_facets_turn_every_backlash(cell: Cell, readings: Readings) -> None:
    judgement = judged(cell, replace(readings, direction=-readings.direction))
    assert "by dX, dY, dZ the axis moved away from the facet" in only(judgement, "doubtful")
    assert {"EXXb", "EYYb"} <= set(judgement.untrusted)


@pytest.mark.few(0)
def test_directions_that_no_column_gives_are_a_note(cell: Cell, readings: Readings) -> None:
    away = np.where([name in cell.machine.linear for name in readings.axes], -1, 1) * readings.direction
    judgement = judged(cell, replace(readings, direction=away, derived=cell.machine.linear))
    assert judgement.verdict == "trustworthy"
    (note,) = [n for n in judgement.remarks if "leads away from the facet" in n]
    assert note.startswith("the last motion of X, Y, Z leads away")
    assert {"EXXb", "EYYb"} <= set(judgement.untrusted)


def test_readings_know_which_directions_no_column_gives(cell: Cell, readings: Readings) -> None:
    text = readings_text(readings)
    assert read_readings_text(text, cell.machine, cell.artefact).derived == ()
    without = text.replace(",dY,", ",T_other,", 1)
    assert read_readings_text(without, cell.machine, cell.artefact).derived == ("Y",)


@pytest.mark.long
def test_a_facet_that_scatters_is_no_chip(cell: Cell, readings: Readings) -> None:
    own = np.array(readings.facet) == "5"
    to_and_fro = np.zeros(len(readings))
    to_and_fro[own] = np.random.default_rng(2).normal(0.0, 0.02, own.sum())
    said = only(judged(cell, pushed(cell, readings, to_and_fro)), "doubtful")
    assert "facet 5 is up to " in said and "some early and some late" in said


@pytest.mark.long
def test_residuals_that_follow_the_feed_are_named(cell: Cell, readings: Readings) -> None:
    fast = np.arange(len(readings)) % 3 == 0
    late = pushed(cell, readings, np.where(fast, -0.030, -0.003))  # 1 ms at 1800 and at 180 mm/min
    judgement = judged(cell, replace(late, feed=np.where(fast, 1800.0, 180.0)))
    # A third of the touches is at the other feed, and has no weight beside the rest: so few are left that nothing is trusted.
    assert re.search("the position is latched (0.99|1) ms too late", only(judgement, "implausible"))
    assert "EXX1" in judgement.untrusted


@pytest.mark.long
@pytest.mark.parametrize("axis", ["X", "Y", "Z", "A"])
def test_a_wrong_sense_comes_before_the_bar_that_it_contradicts(axis: str, cell: Cell, readings: Readings) -> None:
    position = np.array(readings.position)
    position[:, cell.machine.column(axis)] *= -1
    spoilt = replace(readings, position=position)
    found = judge(cell, spoilt, honest(estimate(cell.machine, cell.artefact, spoilt, cell.terms)))
    assert (found.verdict, found.suspicions[0].kind) == ("implausible", "sense")


@pytest.mark.long
def test_gains_that_are_wrong_alike_speak_of_the_bar(cell: Cell, readings: Readings) -> None:
    bar = cell.artefact.scale_bar
    assert bar is not None
    wrong = replace(cell, artefact=replace(cell.artefact, scale_bar=replace(bar, length=bar.length + 0.03)))
    judgement = judged(wrong, readings)
    assert "so is a scale bar that is not as long as stated" in only(judgement, "doubtful")
    assert {"EXX1", "EYY1", "EZZ1"} <= set(judgement.untrusted)


@pytest.mark.long
def test_gains_that_nights_before_have_found_alike_are_no_doubt(cell: Cell, readings: Readings) -> None:
    """A machine that is 6 K warmer stays warm: its second morning blamed the scale bar."""
    bar = cell.artefact.scale_bar
    assert bar is not None
    warm = replace(cell, artefact=replace(cell.artefact, scale_bar=replace(bar, length=bar.length + 0.015)))
    result = honest(estimate(warm.machine, warm.artefact, readings, warm.terms))
    assert "alike" in " ".join(judge(warm, readings, result, search=False).reasons)
    again = judge(warm, readings, result, search=False, agrees=True)
    assert "alike" not in " ".join(again.reasons) and not {"EXX1", "EYY1", "EZZ1"} & set(again.untrusted)


@pytest.mark.long
def test_a_result_says_which_length_its_gains_rest_on(cell: Cell, readings: Readings) -> None:
    judgement = judged(cell, readings)
    said = "EXX1, EYY1, EZZ1 rest on the length of the scale bar as artefact.yaml states it: 200 mm ± 0.0005 mm"
    (note,) = [r for r in judgement.remarks if r.startswith(said)]
    assert judgement.verdict == "trustworthy" and "It moves others, too: EZt by -" in note and "the places of 14 facets by" in note
    bar = cell.artefact.scale_bar
    assert bar is not None
    longer = replace(cell, artefact=replace(cell.artefact, scale_bar=replace(bar, length=bar.length + 0.01)))
    one, two = (estimate(c.machine, c.artefact, readings, c.terms) for c in (cell, longer))
    off = 1e3 * (two.value("EZt") - one.value("EZt"))
    assert float(note.split("EZt by ")[1].split()[0]) == pytest.approx(off, abs=0.3)
    assert not judged(replace(cell, artefact=replace(cell.artefact, scale_bar=None)), readings).remarks


@pytest.mark.long
def test_an_axis_that_bends_and_rolls_is_no_angle_of_an_indexation(root: Path) -> None:
    """Two touches of an indexation that an error motion has thrown out are no reason to name an angle."""
    whole = read_cell(root / "examples" / "hu40t")
    world = read_world(root / "examples/hu40t/world.yaml")
    bent = replace(world, errors={**world.errors, "EYX2": 1.5e-7, "EAX1": 6e-8})
    readings = simulate(whole.machine, whole.artefact, whole.strategy, bent, seed=7)
    said = only(judged(whole, readings), "doubtful")
    assert "from where the readings say" not in said and "an error motion that the terms lack" in said


@pytest.mark.long
def test_single_wrong_touches_are_no_group(cell: Cell, readings: Readings) -> None:
    rng = np.random.default_rng(4)
    wrong = (rng.random(len(readings)) < 0.04) * rng.uniform(0.25, 0.5, len(readings)) * rng.choice([-1, 1], len(readings))
    found = judged(cell, pushed(cell, readings, wrong))
    assert "by more than 0.05 mm" in only(found, "doubtful")  # somebody should look why; they moved nothing
    assert not found.untrusted


@pytest.mark.long
def test_a_chip_on_two_touches_is_a_note_and_on_three_a_reason_to_look(cell: Cell, readings: Readings) -> None:
    wrong = np.zeros(len(readings))
    wrong[[20, 90]] = 0.4
    assert judged(cell, pushed(cell, readings, wrong)).verdict == "trustworthy"
    wrong[150] = 0.4
    assert judged(cell, pushed(cell, readings, wrong)).verdict == "doubtful"


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4, 5, 6])
def test_gains_that_rest_on_balls_whose_touches_do_not_agree_are_untrusted(root: Path, seed: int) -> None:
    cell, world = read_cell(root / "examples" / "trunnion"), read_world(root / "examples/trunnion/world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=seed)
    wrong = replace(
        cell, machine=replace(cell.machine, probe=replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + 0.004))
    )
    found = judged(wrong, readings)
    assert found.verdict == "doubtful" and "touches on ball 1 do not fit the others" in " ".join(found.reasons)
    assert {"EXX1", "EYY1", "EZZ1"} <= set(found.untrusted), "which of these touches is right decides the length of the bar"
