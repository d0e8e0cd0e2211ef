"""A goal, a plan, readings so far → how many touches are still worth making.

What a set of touches determines does not depend on what they read, only on the scatter. So it is known before the run after which
touch the goal is met; and after it, the scatter of the residuals says whether it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..plan import plan
from ..records import Array, Cell, Indexation, InputError, Plan, Readings
from ..touches import from_readings
from . import goals, order
from .balls import information
from .criterion import Criterion, value
from .enough import widened
from .exchange import Draft
from .measured import noise
from .propose import Setting, Wish, setting
from .relaxed import Costs, Relaxed
from .timed import judged, rows_of

MORE = 1.0  # times the time of the strategy that may be appended to it
STEP = 0.1  # of that time, appended at once
WORD = "volume"
CHANCE = 2.33  # standard deviations: so much more scatter comes by chance in one run of a hundred


@dataclass(frozen=True)
class Until:
    """What is to be reached, and by which touches; φ of `criterion` is 1 where it is."""

    ready: Setting
    criterion: Criterion
    cell: Cell  # whose strategy has the appended touches too
    plan: Plan
    rows: Array  # (n, p) of the plan's touches
    appended: int  # touches that the strategy of the cell does not have

    def share(self, made: Sequence[int] | slice, sigma: float | None = None) -> float:
        """rows of touches made, mm of scatter → largest ratio of a standard uncertainty to what is asked for."""
        choice, number = self.ready.problem.choice, np.arange(len(self.rows))[made]
        facets = [self.plan.touches[i].facet for i in number]
        larger = widened(choice, facets) * (1.0 if sigma is None else sigma / choice.sigma)
        return larger * value(self.criterion, information(choice, facets, self.rows[number])) ** 0.5

    def ahead(self, readings: Readings | None) -> tuple[int, float]:
        """readings so far → touches to be made next, 0 when it is reached or none is left; ratio reached so far."""
        choice = self.ready.problem.choice
        place = {touch.number: row for row, touch in enumerate(self.plan.touches)}
        sigma, now, good, tried = choice.sigma, np.inf, [], set[int]()
        if readings is not None:
            tried = {place[number] for number in readings.touch.tolist()}
            good = [place[number] for number in readings.touch[readings.ok].tolist()]
            found = from_readings(choice.cell.machine, choice.cell.artefact, readings)
            sigma = noise(choice, replace(found, artefact=choice.cell.artefact))
            now = self.share(good, sigma)
        left = [row for row in range(len(self.rows)) if row not in tried]
        if now <= 1 or not left:
            return 0, now
        index = [touch.indexation for touch in self.plan.touches]
        for count, row in enumerate(left, 1):
            ends = count == len(left) or index[left[count]] != index[row]
            if ends and self.share([*good, *left[:count]], sigma) <= 1:
                return count, now
        return len(left), now

    def short_of(self, readings: Readings) -> str:
        """readings that do not reach it → why, and what to do: two sentences."""
        choice = self.ready.problem.choice
        missed = int((~readings.ok).sum())
        found = from_readings(choice.cell.machine, choice.cell.artefact, readings)
        ratio = noise(choice, replace(found, artefact=choice.cell.artefact)) / choice.sigma
        return why_short(missed, ratio, max(len(readings.touch) - missed - self.rows.shape[1], 1))


def why_short(missed: int, ratio: float, dof: int) -> str:
    """touches that missed, scatter over the stated one, degrees of freedom → why a goal was not reached, and what to do."""
    longer = "make a longer plan with 'tango design'"
    causes = []
    if ratio > 1 + CHANCE / (2 * dof) ** 0.5:
        causes.append(f"touches scatter {ratio:.2g} times as much as machine.yaml says")
    if missed:
        causes.append(f"touches missed: {missed}")
    if causes:
        return f"Why: {'; '.join(causes)}. Look for the reason, or {longer}"
    return (
        f"No touch missed, and they scatter no more than chance makes of what machine.yaml says ({ratio:.2g} times as much, of "
        f"{dof} degrees of freedom). Nothing is wrong with the machine: {longer}"
    )


def until(cell: Cell, wish: Wish) -> Until:
    """cell, wish with limits → what to run. Raises InputError for a goal without limits, and for one that no appending reaches."""
    limits = dict(wish.goal.limits)
    size = limits.pop(WORD, None)
    if size is not None and limits:
        raise InputError(f"--until: found {wish.goal.text!r}; allowed: volume=µm, or limits of parameters, not both")
    if size is None and wish.goal.word != "locations" and not limits:
        raise InputError(
            f"--until: found {wish.goal.text!r}; allowed: volume=5 (µm rms), locations, or limits such as EX0C=1,EA0C=5"
        )
    ready = setting(cell, replace(wish, goal=goals.Goal(WORD, {}) if size is not None else wish.goal))
    criterion = ready.problem.criterion
    if size is not None:
        assert criterion.spread is not None
        criterion = Criterion(WORD, criterion.spread * (1e3 * ready.problem.choice.sigma / size) ** 2)
    made = plan(cell, "leave-out")
    own = Until(ready, criterion, cell, made, rows_of(ready.problem.choice, made), 0)
    return own if own.share(slice(None)) <= 1 else _longer(own)


def _longer(own: Until) -> Until:
    """what the strategy alone does not reach → the same with touches appended that do. Raises InputError where none do."""
    problem, strategy = own.ready.problem, own.cell.strategy
    choice = problem.choice
    timed = judged(problem, own.cell, own.plan)
    costs = Costs(np.full(len(choice.rows), timed.costs[0]), np.full(len(choice.of_pose), timed.costs[1]))
    criterion = own.criterion if own.criterion.worst is None else own.criterion.with_weights(_even(own.criterion))
    held = information(choice, [touch.facet for touch in own.plan.touches], own.rows)
    draft = Draft(
        choice.rows, choice.pose, choice.of_pose, held, costs, Relaxed(np.empty(0), np.empty(0), 0.0, criterion), choice.pose < 0
    )
    spent = 0.0
    while spent < MORE * timed.seconds:
        spent += STEP * timed.seconds
        draft.fill(spent)
        more = []
        legs = order.Legs(choice.cell, problem.feed, problem.ways.legs)
        for j in np.unique(choice.pose[draft.chosen]).tolist():
            position = dict(choice.cell.strategy.indexations[j].position)
            facets = [choice.facet[i] for i in np.flatnonzero(draft.chosen & (choice.pose == j))]
            more.append(Indexation(position, tuple(legs.way(position, facets))))
        cell = replace(own.cell, strategy=replace(strategy, indexations=(*strategy.indexations, *more)))
        made = plan(cell, "leave-out")
        found = Until(own.ready, own.criterion, cell, made, rows_of(choice, made), len(made.touches) - len(own.plan.touches))
        if found.share(slice(None)) <= 1:
            return found
    raise InputError(
        f"--until: this strategy reaches {own.share(slice(None)):.3g} times what is asked for, and twice its time "
        f"{found.share(slice(None)):.3g} times; allowed: a limit that is no smaller, or a strategy of 'tango design' for it"
    )


def _even(criterion: Criterion) -> Array:
    assert criterion.worst is not None
    return np.full(len(criterion.worst), 1 / len(criterion.worst))
