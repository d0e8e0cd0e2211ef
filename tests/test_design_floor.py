"""What no plan can do: a size of change that no check sees, and indexations that no full run does without."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import special

from tango_cnc.design import floor, goals, how_long, least, propose
from tango_cnc.design.candidates import Candidates
from tango_cnc.design.check import POWER, Seen
from tango_cnc.design.criterion import Criterion, value
from tango_cnc.design.early import NEARLY, in_vain
from tango_cnc.design.enough import determined, serves
from tango_cnc.design.problem import Problem
from tango_cnc.design.relaxed import Costs
from tango_cnc.design.whole import SHAKES
from tango_cnc.files import read_cell
from tango_cnc.records import Approach

EXAMPLES = Path(__file__).parents[1] / "examples"


def a_check(known: float) -> Problem:
    """how well the full run knows its unknowns → a check of 60 touches with two changes."""
    rng = np.random.default_rng(5)
    old, p = rng.normal(size=(60, 8)), 8
    held = np.zeros((p + 2, p + 2))
    held[:p, :p], held[p:, p:] = known * np.eye(p), 1e-3 * np.eye(2)
    worst = np.hstack([np.zeros((5, p)), rng.normal(size=(5, 2))])
    cell: Any = SimpleNamespace(machine=SimpleNamespace(probe=SimpleNamespace(repeatability=0.001)), strategy=None)
    pose, rows = np.zeros(60, dtype=np.int64), np.hstack([old, old[:, :2]])
    choice = Candidates(cell, None, ("f",) * 60, pose, rows, np.ones(p + 2), held, (0, 1))  # type: ignore[arg-type]
    return Problem(choice, Criterion("check", None, worst), 100.0, None, held)


def plan_of(problem: Problem, share: float) -> Any:
    """problem, its bound over its value → the plan of twenty touches."""
    rows = problem.choice.rows[:20]
    phi = value(problem.criterion, problem.held + rows.T @ rows)
    return SimpleNamespace(problem=problem, value=phi, bound=share * phi, seconds=100.0)


def size_of(found: Any) -> float:
    return float(floor.STEPS * found.problem.choice.sigma * found.value**0.5)


def test_no_check_sees_less_than_its_worst_direction_alone_would() -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(3, 3))
        seen = Seen(root @ root.T, rng.normal(size=(6, 3, 3)), rng.normal(size=(2, 3)))
        assert seen.limit() + special.ndtri(POWER) * seen.worst > 0.97 * floor.STEPS * seen.worst  # the limit is of 100 000 draws


def test_no_touches_reach_what_touching_for_ever_does_not() -> None:
    problem = a_check(50.0)
    ever = value(problem.criterion, floor.endless(problem))
    for seed in range(10):
        rows = problem.choice.rows[np.random.default_rng(seed).choice(60, 400)]
        assert value(problem.criterion, problem.held + rows.T @ rows) > ever
    better = a_check(500.0)  # a full run that knows more
    assert value(better.criterion, floor.endless(better)) < ever / 5


def test_the_floor_of_a_time_is_no_lower_than_that_of_any_time() -> None:
    found = plan_of(a_check(50.0), 0.5)
    said = floor.floor(found, 0.001)
    assert said.now == pytest.approx(size_of(found) * 0.5**0.5) and said.ever < said.now and said.minutes is None
    assert floor.floor(plan_of(a_check(50.0), 0.0), 0.001).now == said.ever


def test_it_says_in_how_many_minutes_the_change_that_is_wished_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = a_check(1e6)
    found = plan_of(problem, 0.5)

    class Even:
        """Twice the time has twice the information."""

        def __init__(self, found: Any) -> None:
            self.light, self.rows = problem, problem.choice.rows[:20]

        def chosen(self, seconds: float) -> tuple[np.ndarray, list[str]]:
            return problem.held + seconds / 100 * self.rows.T @ self.rows, []

    monkeypatch.setattr(floor, "Quick", Even)
    size = 2 * floor.WISHED  # half of it takes four times as long
    said = floor.floor(found, size)
    assert said.minutes is not None and 400 / 60 <= said.minutes < 400 / 60 * floor.FINE + 0.5
    assert f"about {said.minutes:g} min" in " ".join(floor.lines(said, size))
    assert "about" not in " ".join(floor.lines(said, 0.004))
    assert "--again" in " ".join(floor.lines(floor.Floor(0.007, 0.006, None), size))


@pytest.mark.few(0)
@pytest.mark.parametrize(("name", "told", "count"), [("fork_head", 3, 11), ("trunnion", 6, 7)])
def test_a_head_tells_three_numbers_at_an_indexation_and_a_table_six(name: str, told: int, count: int) -> None:
    cell = read_cell(EXAMPLES / name)
    aim = goals.read("volume")
    problem = propose.setting(cell, propose.Wish(aim, 10.0, ("S4",), Approach(2.0, 0.5, 180.0))).problem
    assert least.told(problem) == told and least.visits(problem) == count
    rng, choice = np.random.default_rng(2), problem.choice
    some = np.concatenate([choice.of_pose[j] for j in rng.choice(len(choice.of_pose), count - 1, replace=False)])
    rows = choice.rows[some]  # every facet there, and still fewer indexations than it takes
    assert not determined(problem, problem.held + rows.T @ rows)
    assert least.most_told(problem, (2.0, 100.0, 0.0), 100.0 * (count - 1))[0] < least.touches(problem)


@pytest.mark.long
def test_a_time_in_which_only_exchanged_visits_determine_everything_is_not_refused() -> None:
    cell = read_cell(EXAMPLES / "fork_head")
    aim = goals.read("volume")
    problem = propose.setting(cell, propose.Wish(aim, 12.0, ("S4",), Approach(2.0, 0.5, 180.0), feed=6000.0)).problem
    costs = 2.89, 16.6, 33.8  # s of a facet, of a turn, and of all else, as of a plan of ten minutes
    quick = how_long.Quick.__new__(how_long.Quick)
    choice = problem.choice
    quick.found, quick.light, quick.least, quick.relaxed = SimpleNamespace(problem=problem), problem, least.touches(problem), None  # type: ignore[assignment]
    quick.touch, quick.visit, quick.spare = costs
    quick.each = Costs(np.full(len(choice.rows), costs[0]), np.full(len(choice.of_pose), costs[1]))
    plain, exchanged = (quick.chosen(720.0, shakes) for shakes in (0, SHAKES))
    assert plain is not None and not serves(problem, plain[0])
    assert exchanged is not None and serves(problem, exchanged[0])
    assert not in_vain(problem.of_time(720.0 / NEARLY), costs, None)
