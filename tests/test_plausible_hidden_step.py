"""A step of an axis that a plan cannot show: what it may have moved is not to be trusted, whether or not there was one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.trust_parts import judged

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement

ROOT = Path(__file__).parents[1]


def trusted(example: str, step: float, stated: float | None = None) -> tuple[dict[str, float], Judgement, int]:
    """Example, mm by which X stands elsewhere beyond 30 mm, mm that is stated → standard deviations by which each trusted parameter
    is off, judgement, number of parameters.
    """
    cell = read_cell(ROOT / "examples" / example)
    if stated is not None:
        known = replace(cell.machine.tolerances, step=stated)
        cell = replace(cell, machine=replace(cell.machine, tolerances=known))
    truth = read_world(cell.folder / "world.yaml")
    effect = {"cause": "compensation_kink", "axis": "X", "nodes": [29.9, 30.1], "values": [0.0, step]}
    readings = simulate(cell.machine, cell.artefact, cell.strategy, replace(truth, seed=3, effects=(effect,) if step else ()))
    result, judgement = judged(cell, readings, cell.terms, 3)
    off = {}
    for name, value, std in zip(result.parameters, result.values, result.std, strict=False):
        one, _, other = name.partition("-")
        off[name] = (value - truth.errors.get(one, 0.0) + truth.errors.get(other, 0.0)) / std
    return {n: v for n, v in off.items() if n not in judgement.untrusted}, judgement, len(result.parameters)


@pytest.mark.few(0)
@pytest.mark.parametrize("step", [0.0, 0.003, 0.005, 0.008])
def test_what_an_unseen_step_moves_is_not_trusted(step: float) -> None:
    """Gains were trusted, and off by nine of their standard deviations with a step of 8 µm."""
    off, judgement, _ = trusted("fork_head", step)
    assert judgement.verdict == "trustworthy" and {"EXX1", "EYY1", "EZZ1"} <= set(judgement.untrusted)
    assert "cannot show a step of X: a step of 3 µm at" in " ".join(map(str, judgement.remarks))
    assert max(abs(v) for v in off.values()) < 4


@pytest.mark.few(0)
@pytest.mark.parametrize(("example", "least"), [("hu40t", 15), ("trunnion", 17), ("huron", 10), ("split", 9)])
def test_most_parameters_of_a_sound_cell_stay_trusted(example: str, least: int) -> None:
    off, judgement, every = trusted(example, 0.0)
    assert judgement.verdict == "trustworthy" and len(off) >= least >= every / 2


def test_where_a_bend_is_hidden_the_note_speaks_of_steps_too() -> None:
    """Its gains may be compensated: nothing is marked, and the note says what no touch shows."""
    _, judgement, _ = trusted("three_axis_calibrated", 0.0)
    said = " ".join(map(str, judgement.remarks))
    assert judgement.untrusted == () and "nor an error of position that is no gain" in said and "a step of" not in said


@pytest.mark.long
def test_a_step_that_is_known_to_be_smaller_moves_nothing() -> None:
    off, judgement, every = trusted("fork_head", 0.0, 0.0005)
    assert judgement.untrusted == () and len(off) == every


@pytest.mark.few(0)
@pytest.mark.parametrize("example", ["split", "fork_head"])
def test_what_is_marked_for_a_step_that_need_not_be_there_is_acted_on_where_it_is_larger(example: str) -> None:
    """EX0C of split is -31 ± 0.2 µm, and such a step moves it by 1.5 µm: taking it away does more good than harm."""
    _, judgement, _ = trusted(example, 0.0)
    assert set(judgement.stand) <= set(judgement.untrusted)
    assert judgement.stand if example == "split" else set(judgement.stand) < set(judgement.untrusted)
    assert "EX0C" in judgement.stand or example != "split"
