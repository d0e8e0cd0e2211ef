"""What a check is searched with: the changes, and what the full run leaves uncertain of many touches at once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tango_cnc.design import choose
from tango_cnc.design import problem as of_design
from tango_cnc.design.candidates import Candidates
from tango_cnc.design.criterion import Criterion, value
from tango_cnc.design.exchange import Draft
from tango_cnc.design.problem import Problem, lighter
from tango_cnc.design.relaxed import Costs, relax


def check(p: int, seed: int = 1) -> Problem:
    """unknowns of the full run → a check of 60 touches with two changes, which the full run knows very unevenly."""
    rng = np.random.default_rng(seed)
    old = rng.normal(size=(60, p))
    rows, held = np.hstack([old, old[:, :2]]), np.zeros((p + 2, p + 2))
    held[:p, :p] = np.diag(10.0 ** rng.uniform(-1, 3, p))
    held[p:, p:] = 1e-3 * np.eye(2)
    worst = np.hstack([np.zeros((5, p)), rng.normal(size=(5, 2))])
    strategy = SimpleNamespace(indexations=(None,))
    choice = Candidates(
        SimpleNamespace(strategy=strategy),
        None,
        ("f",) * 60,
        np.zeros(60, dtype=np.int64),
        rows,
        np.ones(p + 2),
        held,
        (0, 1),  # type: ignore[arg-type]
    )
    return Problem(choice, Criterion("check", None, worst), 100.0, None, held)


def worth(problem: Problem, some: np.ndarray) -> float:
    rows = problem.choice.rows[some]
    return value(problem.criterion, problem.held + rows.T @ rows)


def test_what_is_lighter_to_search_in_is_worth_the_same_where_all_that_is_uncertain_has_room() -> None:
    whole = check(12)
    light = lighter(whole)
    for seed in range(10):
        some = np.random.default_rng(seed).choice(60, 8, replace=False)
        assert worth(light, some) == pytest.approx(worth(whole, some), rel=1e-9)
    assert light.choice.twice == () and len(light.held) == 14


def test_with_less_room_what_one_error_spoils_of_many_touches_still_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = check(30)
    some = [np.random.default_rng(seed).choice(60, 8, replace=False) for seed in range(20)]
    exact = np.array([worth(whole, s) for s in some])
    off = []
    for room in (2, 12, 22, 32):
        monkeypatch.setattr(of_design, "FEWER", room)
        off.append(float(np.abs(np.log([worth(lighter(whole), s) for s in some] / exact)).max()))
    assert off == sorted(off, reverse=True) and off[-1] < 1e-9 < 0.1 < off[0], off


@pytest.mark.parametrize("criterion", [Criterion("D"), Criterion("I", np.diag([1.0, 0, 0, 0, 0, 2])), Criterion("A", np.eye(6))])
def test_the_visit_that_tells_least_is_that_of_looking_at_all(criterion: Criterion) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        rows = rng.normal(size=(90, 6)) * rng.uniform(0.1, 3, size=(90, 1))
        pose = np.sort(np.concatenate([np.arange(12), rng.integers(0, 12, 78)]))
        of_pose = [np.flatnonzero(pose == j) for j in range(12)]
        costs = Costs(rng.uniform(1, 3, 90), rng.uniform(5, 20, 12))
        draft = Draft(
            rows,
            pose,
            of_pose,
            np.eye(6),
            costs,
            relax(rows, of_pose, np.eye(6), costs, 150.0, criterion, None, 2),
            np.ones(90, bool),
        )
        draft.needed = rng.random(90) < 0.03
        rates = {j: draft.visit_rate(j) for j in range(12)}
        least = min(rates, key=lambda j: rates[j])
        assert draft.least_visit(np.flatnonzero(~draft.needed)) == (least, rates[least])


def test_a_first_plan_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    monkeypatch.setattr(choose, "_made_first", lambda problem: made.append(problem.seconds) or (problem.seconds, None))
    whole = replace(check(4), senses=SimpleNamespace())  # type: ignore[arg-type]
    assert [choose.quick(whole.of_time(s)) for s in (300.0, 200.0, 300.0)] == [300.0, 200.0, 300.0]
    choose.quick(replace(whole.of_time(300.0), criterion=Criterion("D")))
    assert made == [300.0, 200.0, 300.0]
