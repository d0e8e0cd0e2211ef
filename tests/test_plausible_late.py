"""Touches that are wrong to one side, a spindle that stands still, and single mistakes that outsiders made: named, with numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.coverage import pushed
from support.estimated import judged

from sim_controller.simulate import simulate
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.kinematics import chain, tip
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.plausible.spindle import standing
from tango_cnc.records import Array, Cell, Readings, World
from tango_cnc.touches import from_readings

Measured = tuple[Cell, World, Readings]


@pytest.fixture(scope="module")
def measured(pytestconfig: pytest.Config) -> Measured:
    folder = pytestconfig.rootpath / "examples" / "trunnion"
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    return cell, world, simulate(cell.machine, cell.artefact, cell.strategy, world, seed=31)


def farthest(result: Estimate, world: World) -> float:
    """The largest deviation from the truth, in standard deviations."""
    return max(abs(p.value - world.errors.get(name, 0.0)) / p.std for name, p in result.parameters.items())


@pytest.mark.long
@pytest.mark.parametrize(
    ("share", "size"), [(0.4, 0.1), pytest.param(0.4, 0.01, marks=pytest.mark.long), pytest.param(0.5, 0.1, marks=pytest.mark.long)]
)
def test_touches_late_to_one_side_are_told_from_the_others(measured: Measured, share: float, size: float) -> None:
    cell, world, readings = measured
    late = np.random.default_rng(5).random(len(readings)) < share
    spoilt = pushed(cell, readings, np.where(late, -size, 0.0))
    result = honest(estimate(cell.machine, cell.artefact, spoilt, cell.terms))
    judgement = judge(cell, spoilt, result)
    agree = np.mean(result.out == late)
    assert max(agree, 1 - agree) > 0.95, "which are late and which early is one and the same where both are half"
    assert judgement.verdict == "implausible" and {*result.parameters, *result.setup} <= set(judgement.untrusted)
    assert judgement.suspicions[0].kind == "late_touches"
    if share < 0.5:
        assert f"read {size * 1000:.3g}"[:6] in judgement.suspicions[0].text
        assert farthest(result, world) < 4


@pytest.mark.long
def test_late_touches_of_all_sizes_are_told_from_the_others(measured: Measured) -> None:
    cell, world, readings = measured
    rng = np.random.default_rng(5)
    late = rng.random(len(readings)) < 0.4
    spoilt = pushed(cell, readings, np.where(late, -0.3 * rng.random(len(readings)), 0.0))
    result = honest(estimate(cell.machine, cell.artefact, spoilt, cell.terms))
    assert farthest(result, world) < 4 and np.mean(result.out == late) > 0.95
    assert judge(cell, spoilt, result).suspicions[0].kind == "late_touches"


@pytest.mark.long
def test_a_dozen_touches_that_met_nothing_bend_no_parameter(measured: Measured) -> None:
    cell, world, readings = measured
    wrong = np.zeros(len(readings))
    wrong[np.random.default_rng(3).choice(len(readings), 12, replace=False)] = -4.0
    plain = estimate(cell.machine, cell.artefact, pushed(cell, readings, wrong), cell.terms)
    assert abs(plain.parameters["EY0C"].value - world.errors["EY0C"]) > 0.02, "least squares follows them"
    assert farthest(honest(plain), world) < 4
    assert set(np.flatnonzero(wrong) + 1) <= set(honest(plain).outliers.tolist())


@pytest.mark.few(0)
@pytest.mark.parametrize("turns", [True, False])
def test_a_spindle_that_stands_still_is_not_trusted_with_its_place(measured: Measured, turns: bool) -> None:
    cell, world, readings = measured
    standing = tuple(replace(i, position={**i.position, "S": 0.0}) for i in cell.strategy.indexations)
    strategy = cell.strategy if turns else replace(cell.strategy, indexations=standing)
    made = simulate(cell.machine, cell.artefact, strategy, world, seed=32)
    judgement = judged(cell, replace(made, position=readings.position + (made.position - readings.position) * _linear(cell)))
    if turns:
        assert judgement.verdict == "trustworthy" and not judgement.suspicions
    else:
        assert judgement.verdict == "doubtful" and {"EX0S", "EY0S", "EXt", "EYt"} <= set(judgement.untrusted)
        assert judgement.suspicions[0].kind == "spindle_still"


@pytest.mark.long
@pytest.mark.parametrize(
    ("runout", "stated", "verdict"), [(0.0, None, "doubtful"), (1e-3, None, "trustworthy"), (0.0, 1e-3, "trustworthy")]
)
def test_a_stylus_that_runs_true_is_in_doubt_only_where_a_lost_M19_is_likelier(
    measured: Measured, runout: float, stated: float | None, verdict: str
) -> None:
    cell, world, _ = measured
    known = replace(cell.machine, tolerances=replace(cell.machine.tolerances, runout=stated))
    cell, true = replace(cell, machine=known), replace(world, stylus={**world.stylus, "EXt": runout, "EYt": 0.0})
    judgement = judged(cell, simulate(cell.machine, cell.artefact, cell.strategy, true, seed=33))
    assert judgement.verdict == verdict
    assert set(judgement.untrusted) == {"EX0S", "EY0S", "EXt", "EYt"}, "whatever the verdict, these four rest on the spindle"
    assert any("tolerances.runout" in text for text in (*judgement.reasons, *judgement.remarks))


@pytest.mark.parametrize(
    ("runout", "std", "usual", "least", "most"),
    [
        (0.0, 0.0002, 0.005, 10, 15),  # nothing seen, and known well: the spindle stood still, most likely
        (0.0002, 0.0002, 0.005, 5, 10),
        (0.0007, 0.0002, 0.005, 0.01, 0.05),
        (0.0, 0.001, 0.005, 0.05, 1),  # nothing seen, but hardly known: styli that run so true are not rare
        (0.0, 0.0002, 0.0005, 0.05, 1),  # it was stated to run so true
        (0.002, 0.0002, 0.005, 0.0, 1e-6),
    ],
)
def test_the_odds_of_a_spindle_that_stands_still(runout: float, std: float, usual: float, least: float, most: float) -> None:
    assert least <= standing(np.array([runout, 0.0]), np.eye(2) * std**2, usual) < most


def _linear(cell: Cell) -> Array:
    return np.array([name in cell.machine.linear for name in cell.machine.names], dtype=float)


def _columns(change: Callable[[Cell, Array], None]) -> Callable[[Cell, Readings], Readings]:
    def spoilt(cell: Cell, readings: Readings) -> Readings:
        position = np.array(readings.position)
        change(cell, position)
        return replace(readings, position=position)

    return spoilt


def _gon(cell: Cell, p: Array) -> None:
    p[:, [cell.machine.column(n) for n in "AC"]] /= 0.9


def _screw(cell: Cell, p: Array) -> None:
    p[:, cell.machine.column("Z")] *= 1.003


def _offset(cell: Cell, p: Array) -> None:
    p[:, cell.machine.column("Y")] += 5.0


def _signless(cell: Cell, p: Array) -> None:
    half, x = len(p) // 2, cell.machine.column("X")
    p[half:, x] = np.abs(p[half:, x])


def _pasted(cell: Cell, p: Array) -> None:
    p[90:102, :3] = p[50:62, :3]


def _tool_centre(cell: Cell, p: Array) -> None:
    p[:, :3] = tip(chain(cell.machine), p)


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "kind", "word"),
    [
        (_gon, "rotary_gain", "A and C are in gon"),
        pytest.param(_offset, "zero_offset", "Y by -5.0", marks=pytest.mark.long),
        pytest.param(_screw, "linear_gain", "Z goes 0.997", marks=pytest.mark.long),
        pytest.param(_signless, "lost_sign", "X has the other sign", marks=pytest.mark.long),
        pytest.param(_pasted, "copied_positions", "these rows were copied", marks=pytest.mark.long),
        pytest.param(_tool_centre, "tool_centre_point", "tool center point", marks=pytest.mark.long),
    ],
)
def test_a_mistake_is_named_first_and_fits(measured: Measured, change: Callable[[Cell, Array], None], kind: str, word: str) -> None:
    cell, _, readings = measured
    judgement = judged(cell, _columns(change)(cell, readings))
    first = judgement.suspicions[0]
    assert judgement.verdict == "implausible"
    assert (first.kind, first.fits) == (kind, True) and word in first.text


@pytest.mark.long
def test_a_tip_that_is_a_tenth_too_small_shows_on_the_balls(measured: Measured) -> None:
    cell, _, readings = measured
    machine = replace(cell.machine, probe=replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + 0.1))
    judgement = judged(replace(cell, machine=machine), readings)
    assert judgement.verdict != "trustworthy"
    assert judgement.suspicions[0].kind == "tip_radius" and "radius of 3" in judgement.suspicions[0].text


@pytest.mark.long
def test_backlashes_that_are_all_alike_may_be_the_tip(pytestconfig: pytest.Config) -> None:
    folder = pytestconfig.rootpath / "examples" / "fork_head"
    cell = read_cell(folder)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=31)
    machine = replace(cell.machine, probe=replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + 0.08))
    result = honest(estimate(machine, cell.artefact, readings, cell.terms))
    judgement = judge(replace(cell, machine=machine), readings, result, search=False)
    assert result.value("EXXb") < -0.07 and judgement.verdict == "doubtful"
    assert {"EXXb", "EYYb", "EZZb"} <= set(judgement.untrusted)
    assert any("backlashes of X, Y are alike" in reason for reason in judgement.reasons)


@pytest.mark.long
@pytest.mark.parametrize(
    ("example", "axis", "sign", "size", "verdict", "named"),
    [
        ("trunnion", 0, 1, 0.016, "doubtful", ("EX0S", "EXXb")),
        ("fork_head", 0, -1, 0.012, "trustworthy", ("EXXb",)),  # nothing in the readings speaks against it
        ("trunnion", 0, 1, -0.016, "doubtful", ("EX0S", "EXXb")),
        pytest.param("trunnion", 0, 0, -0.006, "trustworthy", ("EXXb",), marks=pytest.mark.long),
        pytest.param("split", 1, -1, 0.027, "doubtful", ("EY0S", "EYYb"), marks=pytest.mark.long),
        pytest.param("trunnion", 0, 0, 0.03, "doubtful", ("EXXb",), marks=pytest.mark.long),
        pytest.param("trunnion", 0, -1, 0.016, "doubtful", ("EX0S", "EXXb"), marks=pytest.mark.long),
        pytest.param("fork_head", 0, -1, 0.028, "doubtful", ("EXXb",), marks=pytest.mark.long),
    ],
)
def test_late_or_early_one_way_and_backlash_cannot_be_told_apart_and_the_result_says_so(
    pytestconfig: pytest.Config, example: str, axis: int, sign: int, size: float, verdict: str, named: tuple[str, ...]
) -> None:
    folder = pytestconfig.rootpath / "examples" / example
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=9)
    found = []
    for late in (0.0, size):
        normal = from_readings(cell.machine, cell.artefact, readings).machine_normal[:, axis]
        toward = normal * sign > 0.5 if sign else np.abs(normal)  # both ways: as much as the axis has of the touch
        result = honest(estimate(cell.machine, cell.artefact, pushed(cell, readings, -late * toward), cell.terms))
        judgement = judge(cell, readings, result, search=False)
        found.append([t for t in (*judgement.reasons, *judgement.remarks) if "cannot tell the backlash" in t])
    letter = "XYZ"[axis]
    assert not found[0], "nothing is late"
    side = {1: "-", -1: "+", 0: "±"}[sign]
    said, *others = found[1]
    assert all(t in judgement.remarks for t in others), "what else may look so is a note, no reason"
    assert ("latched late" if size > 0 else "read early") in said
    way = next(w for w in re.split(": |, or ", said) if (f"toward {letter}{side} (" in w if sign else "both ways (" in w))
    assert judgement.verdict == verdict and all(name in way for name in named)
    assert float(way.split(" ")[0]) == pytest.approx(abs(size) * 1000.0, rel=0.15)
    assert set(named) <= set(judgement.untrusted)
    wrong = [n for n in named if abs(result.value(n) - world.errors.get(n, 0.0)) > 5 * result.parameters[n].std]
    assert set(wrong) == set(named), "what is named is really wrong by many standard deviations"


@pytest.mark.long
def test_a_tip_calibrated_too_small_on_one_side_is_not_told_from_backlash_and_nothing_it_moves_is_trusted(
    pytestconfig: pytest.Config,
) -> None:
    folder = pytestconfig.rootpath / "examples" / "hu40t"
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=7)
    toward = np.clip(from_readings(cell.machine, cell.artefact, readings).machine_normal[:, 1], 0.0, None)
    result = honest(estimate(cell.machine, cell.artefact, pushed(cell, readings, 0.03 * toward), cell.terms))
    judgement = judge(cell, readings, result, search=False)
    wrong = {n for n, p in result.parameters.items() if abs(p.value - world.errors.get(n, 0.0)) > 5 * p.std}
    assert wrong == {"EY0S", "EYYb"} <= set(judgement.untrusted) and judgement.verdict == "doubtful"
    assert result.sigma < 2 * cell.machine.probe.repeatability, "the fit shows nothing of it"


@pytest.mark.long
@pytest.mark.parametrize(("stated", "trusted"), [(0.002, True), (0.05, False)])
def test_backlash_beyond_what_a_calibrated_tip_can_make_is_trusted(measured: Measured, stated: float, trusted: bool) -> None:
    cell, world, _ = measured
    machine = replace(cell.machine, tolerances=replace(cell.machine.tolerances, direction=stated))
    worn = replace(world, errors={**world.errors, "EXXb": 0.014})
    readings = simulate(machine, cell.artefact, cell.strategy, worn, seed=9)
    result = honest(estimate(machine, cell.artefact, readings, cell.terms))
    judgement = judge(replace(cell, machine=machine), readings, result, search=False)
    assert (judgement.verdict == "trustworthy") == trusted == ("EXXb" not in judgement.untrusted)
    (said,) = [t for t in (*judgement.reasons, *judgement.remarks) if "backlash of X" in t]
    assert ("2.0 µm both ways (EXXb +2.0)" in said) == trusted
