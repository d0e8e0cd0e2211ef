"""What `tango design` says beforehand of parameters that `tango estimate` will not trust, and of those that a plan hardly sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.design import doubts, goals, prior, propose
from tango_cnc.design.problem import Chosen
from tango_cnc.design.propose import Setting, Wish
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell
from tango_cnc.noise import honest
from tango_cnc.plan import last_moves, plan
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, World

EXAMPLES = Path(__file__).parents[1] / "examples"


def of_its_own(cell: Cell) -> tuple[Setting, Chosen]:
    """cell → its own strategy as if `tango design --goal locations` had made it."""
    aim = goals.read("locations")
    ready = propose.setting(cell, Wish(aim, 5.0, ("S3",), cell.strategy.approach))
    return ready, propose.same_time(ready, cell, plan(cell, "leave-out"))


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["trunnion", "hu40t"])
def test_design_names_what_the_estimate_of_a_faultless_run_will_not_trust(name: str) -> None:
    cell = read_cell(EXAMPLES / name)
    ready, found = of_its_own(cell)
    readings = simulate(
        cell.machine,
        cell.artefact,
        cell.strategy,
        World(noise=cell.machine.probe.repeatability, stylus={"EXt": 0.02, "EYt": -0.013}),
        seed=11,
        moved=last_moves(found.plan),
    )
    result = honest(estimate(cell.machine, cell.artefact, readings, ("S3",)))
    judged = judge(replace(cell, terms=("S3",)), readings, result)
    said = doubts.untrusted(ready, found)
    assert judged.verdict == "trustworthy"
    assert set(said["untrusted"]) == set(judged.untrusted)


@pytest.mark.long
def test_a_machine_that_may_step_more_has_more_that_nobody_should_trust() -> None:
    cell = read_cell(EXAMPLES / "hu40t")
    names = []
    for step in (1e-5, 0.003):
        machine = replace(cell.machine, tolerances=replace(cell.machine.tolerances, step=step))
        names.append(set(doubts.untrusted(*of_its_own(replace(cell, machine=machine)))["untrusted"]))
    assert names[0] < names[1]


@pytest.mark.long
def test_what_a_plan_hardly_sees_is_more_uncertain_than_such_an_error_is_large() -> None:
    cell = read_cell(EXAMPLES / "trunnion")
    ready, found = of_its_own(cell)
    assert not doubts.weak(ready, found, 1.0)
    coarse = doubts.weak(ready, found, 100.0)  # touches that scatter a hundred times as much
    usual = dict(zip(ready.problem.choice.selection.model.names, prior.usual(ready.problem.choice), strict=True))
    std = {name: 100 * value for name, (value, _) in propose.std_of(ready, found.information).items()}
    assert coarse.keys() == {name for name in std if std[name] > usual[name.removesuffix("-EXX1")]} - {"EXt", "EYt", "EZt"}
    assert all(np.isclose(own["std"], std[name]) for name, own in coarse.items())


def test_lines_name_both_and_nothing_where_there_is_nothing() -> None:
    data = {"untrusted": ["EZZ1"], "untrusted_why": ["a step of Z"], "weak": {"EXX3": {}}}
    said = "\n".join(doubts.lines(data))
    assert "EZZ1" in said and "a step of Z" in said and "hardly seen" in said and "EXX3" in said
    assert not doubts.lines({"untrusted": [], "untrusted_why": [], "weak": {}})
