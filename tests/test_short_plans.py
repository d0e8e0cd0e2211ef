"""Short plans: what `tango design` promises in some minutes is what `tango estimate` then gives, on machines with nothing wrong.

The machines and their readings are the simulator's; it shares no mathematics with either.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.design_parts import change_text, no_shorter
from support.designs import quickly
from support.trust_parts import judged

from sim_controller.simulate import simulate
from tango_cnc.commands.check import check
from tango_cnc.commands.estimate import _predicting
from tango_cnc.design import choose, goals, how_long, nested, propose, shortest
from tango_cnc.design.changed import Change
from tango_cnc.design.criterion import Criterion
from tango_cnc.design.enough import SPARE, to_spare
from tango_cnc.design.here import bound_here
from tango_cnc.design.propose import Wish
from tango_cnc.estimate import Estimate, student
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement
from tango_cnc.noise._system import beside
from tango_cnc.plan import last_moves, plan
from tango_cnc.plausible.lacking import gained
from tango_cnc.records import Approach, Array, Cell, Indexation, InputError, World
from tango_cnc.verify import held_out
from tango_cnc.verify.held_out import _chance

EXAMPLES = Path(__file__).parents[1] / "examples"
CLOSE = Approach(2.0, 0.5, 180.0)  # mm, mm, mm/min: facets are where they should be
# S, B, C in degrees: what a design of five minutes for the locations of hu40t is like
FIVE_MINUTES = (
    (0, 0, 72, "202 203 102 103 101 105 105 3"),
    (0, 0, -144, "6 6 10 10 101 101 105 203 203 201 201 202"),
    (0, -90, -144, "201 201 204 204 203 203 103 101 104 104 6 6 6 10 10"),
    (270, 90, 0, "10 10 6 6 6 6 104 104 101 101 105 105"),
    (270, 0, 0, "3 3 105 101 101 101 6 6 6"),
    (0, 0, 72, "203 102 103 101 101"),
)


def short() -> Cell:
    cell = read_cell(EXAMPLES / "hu40t")
    every = tuple(
        Indexation({"S": radians(s), "B": radians(b), "C": radians(c)}, tuple(facets.split())) for s, b, c, facets in FIVE_MINUTES
    )
    return replace(cell, strategy=replace(cell.strategy, indexations=every, approach=CLOSE))


def usual(name: str, rng: np.random.Generator) -> World:
    """example, random numbers → a machine of that kind with errors of a usual size, and nothing wrong but that touches scatter."""
    world = read_world(EXAMPLES / name / "world.yaml")
    size = {n: 5e-4 if n[1] in "XYZ" else 6e-6 for n in world.errors if n.endswith("b")}
    size |= {n: 15e-6 for n in world.errors if n.endswith("1")}
    errors = {n: float(rng.normal(0, size.get(n, 0.02 if n[1] in "XYZ" else 20e-6))) for n in world.errors}
    facets = {f: float(rng.normal(0, 0.03)) for f in world.facets}
    return replace(world, errors=errors, facets=facets, stylus={n: float(rng.normal(0, 0.02)) for n in world.stylus})


def run(cell: Cell, name: str, moved: Array | None, seed: int) -> tuple[Estimate, Judgement, Array]:
    """cell, example, last motions, seed → estimate, judgement as the command makes it, errors over their standard deviations."""
    rng = np.random.default_rng(seed)
    world = usual(name, rng)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=seed, moved=moved)
    result, judgement = judged(cell, readings, cell.terms)
    truth = world.errors | world.stylus
    off = [(p.value - truth.get(n, 0.0)) / p.std for n, p in result.parameters.items()]
    return result, _predicting(cell, readings, cell.terms, 3, judgement), np.array(off)


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", [5, 6])
def test_a_displacement_that_unknowns_stand_for_is_no_seating(seed: int) -> None:
    cell = short()
    result, judgement, off = run(cell, "hu40t", last_moves(plan(cell)), seed)
    assert result.noise is not None and (result.noise.walk, result.noise.seating) == (0.0, 0.0)
    assert not result.unused.any() and judgement.verdict == "trustworthy", judgement.reasons
    assert np.abs(off).max() < 4


def test_of_a_component_only_what_no_unknown_does_as_well_is_seen() -> None:
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.normal(size=(60, 20)))[0]
    part = np.column_stack([basis[:, 0] + 1e-4 * rng.normal(size=60), rng.normal(size=(60, 2))])
    turn, seen = beside(part, basis)
    assert seen.tolist() == [False, True, True]
    assert abs(turn[0, 0]) > 0.999


def test_few_touches_to_spare_widen_a_standard_deviation_as_student_says() -> None:
    assert student(10) == pytest.approx(2.228 / 1.960, rel=1e-3)
    assert student(341) == 1.0 and 1.0 < student(100) < 1.02


def test_what_chance_makes_of_held_out_touches_is_the_f_distribution() -> None:
    # 12 touches that scatter each for itself count for half, against a scatter from 9: the 0.1 % point of F(6, 9) is 11.13
    assert _chance([(6.0, 6.0, 9), (6.0, 6.0, 9)]) == pytest.approx(11.13**0.5, rel=1e-3)
    # off together in each group, these count for one: F(1, 9) is 22.86
    assert _chance([(6.0, 36.0, 9), (6.0, 36.0, 9)]) == pytest.approx(22.86**0.5, rel=1e-3)
    assert _chance([]) == 0.0


def test_touches_that_tell_nothing_of_the_goal_have_a_bound() -> None:
    rows = np.zeros((4, 3))
    rows[:, 0] = 1.0
    aim = Criterion("limits", None, np.array([[0.0, 1.0, 0.0]]))
    assert bound_here(rows, np.eye(3), np.ones(4), 2.0, aim) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("moved", "p", "left", "said"),
    [
        (0.002, 0.5, 0.5, ["not changed: "]),
        (0.020, 0.5, 0.5, ["changed: ", "the surest parameter is EX0C: +20.0 ± 1.0 µm", "Make a full run."]),
        (0.002, 2e-46, 1e-40, ["changed: the touches differ", "axis locations, gains and backlashes do not", "Make a full run."]),
        (
            0.002,
            2e-46,
            0.3,
            ["changed: the touches differ", "the surest parameter is EX0C", "changes of axis locations, gains", "Make a full run."],
        ),
        (0.020, 2e-46, 1e-40, ["changed: ", "the surest parameter is EX0C", "besides, the touches differ", "Make a full run."]),
    ],
)
def test_a_check_says_one_verdict(moved: float, p: float, left: float, said: list[str]) -> None:
    change = Change(moved, 0.01, p, left, 1 / 730, {"EX0C": (0.02, 0.001)}, {"EX0C": "mm"})
    lines = change_text(change).splitlines()
    assert [line.startswith(begin) for line, begin in zip(lines, said, strict=True)] == [True] * len(said)
    assert change_text(change).count("not changed") == (0 if change.changed else 1)


def test_a_column_of_a_pattern_that_is_rounding_explains_nothing() -> None:
    rows = np.random.default_rng(3).normal(size=(2, 12)) * [[1e-16], [1.0]]
    gram, pull = rows @ rows.T, rows @ np.ones(12)
    with_it, without = gained(gram[None], gram[None], pull[None]), gained(gram[None, 1:, 1:], gram[None, 1:, 1:], pull[None, 1:])
    assert with_it[0] == pytest.approx(without[0]) and with_it[1] == without[1] == 1


@pytest.mark.long
def test_indexations_that_cannot_be_held_out_are_named_and_the_others_are_predicted(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = short()
    # Without indexation 2 the touches hardly separate two of the unknowns: an estimate does not settle.
    few = tuple(replace(i, facets=i.facets[:12]) for i in cell.strategy.indexations)
    cell = replace(cell, strategy=replace(cell.strategy, indexations=few))
    readings = simulate(cell.machine, cell.artefact, cell.strategy, usual("hu40t", np.random.default_rng(3)), seed=3)
    before = Judgement("trustworthy", remarks=("before",))
    judgement = _predicting(cell, readings, cell.terms, 3, before)
    assert judgement.verdict == "trustworthy" and judgement.remarks[0] == "before"
    assert [text.split(":")[0] for text in judgement.remarks[1:]] == ["indexations 2 were not predicted from the others"]
    monkeypatch.setattr(held_out.HeldOut, "beyond", 2.0)
    assert _predicting(cell, readings, cell.terms, 3, before).verdict == "doubtful"
    judgement = _predicting(cell, readings.rows(np.arange(8)), cell.terms, 3, before)
    assert judgement.remarks[1].startswith("no indexation was predicted from the others")


def designed(name: str, goal: str, minutes: float | None = None, feed: float | None = None) -> propose.Setting:
    cell = read_cell(EXAMPLES / name)
    aim = goals.read(goal)
    return propose.setting(cell, Wish(aim, minutes, propose.usual_terms(aim, cell.terms), CLOSE, feed=feed))


@pytest.mark.long
@pytest.mark.parametrize(("name", "goal", "minutes"), [("trunnion", "EX0S=1,EY0C=1", None), ("hu40t", "locations", 5.0)])
def test_what_a_plan_of_some_minutes_promises_is_kept(
    name: str, goal: str, minutes: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shortest, "ENOUGH", 2)  # searches: more of them make a plan that is shorter by some percent
    monkeypatch.setattr(nested, "FRACTIONS", (0.75,))  # what parts of the run are worth is not asked here
    found = propose.propose(designed(name, goal, minutes))
    assert to_spare(found) >= SPARE and (minutes is not None or found.seconds < 120)
    assert minutes is not None or shortest.touches_hold(found)
    cell = found.cell
    moved = last_moves(found.plan)
    promised = check(cell, found.plan, cell.terms, 3)["expected_std"]
    verdicts, apart, against = [], [], []
    for seed in range(20):
        result, judgement, off = run(cell, name, moved, 7000 + seed)
        verdicts.append(judgement.verdict)
        apart.append(off)
        if judgement.verdict == "trustworthy":  # a run in doubt says itself that it is not what was promised
            against.append(off * [p.std / promised[n]["std"] for n, p in result.parameters.items()])
    assert verdicts.count("trustworthy") >= 19 and "implausible" not in verdicts
    assert np.mean(np.abs(apart) < 1.96) > 0.92  # one run errs in many parameters at once
    assert 0.85 < np.sqrt(np.mean(np.square(against))) < 1.15


@pytest.mark.long
def test_a_goal_that_the_usual_minutes_do_not_serve_takes_as_long_as_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    quickly(monkeypatch)
    said: list[str] = []
    ready = designed("three_axis_calibrated", "locations", None, 200.0)  # mm/min of protected moves
    ready = replace(ready, problem=replace(ready.problem, say=said.append))
    found = propose.propose(ready)
    assert "a plan of 5.0 min: a first one" in said, "somebody sits before a screen that stands still"
    own = [text for text in said if not text.startswith("for a run that is broken off, ")]
    assert own[-1] == f"a plan of {found.problem.seconds / 60:.1f} min: the order of its touches"
    assert found.seconds > 300 and to_spare(found) >= SPARE
    monkeypatch.setattr(how_long, "needed", lambda *_: 20.0)  # looked for above
    with pytest.raises(InputError, match="--minutes: found 5"):
        propose.propose(replace(ready, wish=replace(ready.wish, minutes=5.0)))


@pytest.mark.parametrize(("worst", "spare", "holds"), [(0.03, 15, True), (0.99, 15, True), (0.99, 18, False), (0.03, 40, False)])
def test_a_plan_is_no_shorter_for_its_touches_or_for_its_limits(
    worst: float, spare: int, holds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shortest, "promised", lambda found: found.value)
    monkeypatch.setattr(shortest, "to_spare", lambda found: found.spare)
    found = SimpleNamespace(value=worst, rows=range(50), spare=spare)
    assert shortest.touches_hold(found) is holds  # type: ignore[arg-type]


def test_why_a_plan_is_no_shorter_names_the_touches_that_it_needs() -> None:
    assert "has 34 unknowns of them" in (said := no_shorter(34, 50)) and "49 in all; this plan has 50" in said


@pytest.mark.parametrize("begin", [20.0, 80.0, 97.0, 103.0, 130.0, 400.0])
def test_the_shortest_plan_for_limits_takes_a_handful_of_searches(begin: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A touch every 2 s, 30 unknowns: 90 s for 15 touches to spare; 97.5 s for the limits, with 30 s of turns and gate."""
    tried = []

    def searched(problem: SimpleNamespace) -> SimpleNamespace:
        tried.append(problem.seconds)
        touches = int(problem.seconds / 2)
        if touches < 30:
            raise choose.NoTime("allow more time")
        worst = 67.5 / (problem.seconds - 30)
        return SimpleNamespace(problem=problem, seconds=problem.seconds, value=worst, rows=range(touches), spare=touches - 30)

    monkeypatch.setattr(shortest, "_begin", lambda _: begin)
    monkeypatch.setattr(shortest, "to_spare", lambda found: found.spare)
    monkeypatch.setattr(shortest, "promised", lambda found: found.value)
    monkeypatch.setattr(shortest, "believed", lambda found: found.spare >= SPARE)
    monkeypatch.setattr(choose, "chosen", searched)
    found = shortest.shortest(SimpleNamespace(say=print, of_time=lambda s: SimpleNamespace(seconds=s)))  # type: ignore[arg-type]
    assert 97.5 <= found.seconds <= 97.5 * 1.1 and len(tried) <= shortest.TRIES, tried
