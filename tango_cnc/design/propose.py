"""Cell and goal → the plan that serves it, with everything that is to be told of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..duration import of_moves, proof
from ..identify import SUBSETS, select
from ..model import Model, linearise
from ..plan import plan
from ..records import Approach, Array, Cell, InputError, Plan, Readings, TermItem
from ..terms import inter_axis
from ..touches import from_readings
from . import candidates, check, choose, goals, how_long, prior, region, timed
from . import regular as plain
from .balls import information
from .broken_off import LOSS
from .candidates import Candidates
from .criterion import value
from .enough import determined, serves
from .goals import Goal
from .problem import Chosen, Problem
from .refused import InVain, refused, undetermined, worth_making
from .region import Levers, Region
from .shortest import shortest

CHECK = 8.0  # minutes at most of a check for which nobody states a time
WELL = 0.004  # mm, standard deviation of the worst change: about 20 µm are seen
TRIES = 7  # times that are looked at at most where the usual minutes of a goal do not do
DIGITS = 2  # of a degree, of an indexation in readings


@dataclass(frozen=True)
class Wish:
    """What somebody asks for."""

    goal: Goal
    minutes: float | None
    terms: tuple[TermItem, ...]
    approach: Approach
    degree: int = 3
    feed: float | None = None  # mm/min of protected moves
    box: tuple[tuple[float, float], ...] | None = None  # mm, table frame, where parts are made
    before: Readings | None = None  # of the full run that a check rests on; None: the cell's strategy as planned
    stylus: float = check.STYLUS  # mm within which it comes back to the spindle, for a check
    gate: str = "none"  # of the profile
    typed: str = ""  # the command line that asks for it, without --terms, where there is one
    loss: float = LOSS  # of the uncertainty of the whole plan, for a run that is broken off


@dataclass(frozen=True)
class Setting:
    """A wish made ready: the problem, and where parts are made."""

    wish: Wish
    problem: Problem
    lever: Levers
    where: Region
    full: float | None = None  # s of the full run that a check rests on, where that is known


def usual_terms(goal: Goal, own: Sequence[TermItem]) -> tuple[TermItem, ...]:
    """goal, terms of the cell → terms that such a plan is made for: whole error motions for a volume, locations for the others.

    Where the cell names its locations one by one, these are what its estimate will have.
    """
    more = tuple(item for item in own if item not in SUBSETS)
    if goal.word in ("volume", "D", "A", "condition"):
        return ("S4", *more)
    if "S4" not in own and any(isinstance(item, str) and inter_axis.PATTERN.fullmatch(item) for item in own):
        return tuple(own)
    return ("S3", *more)


def setting(cell: Cell, wish: Wish, say: Callable[[str], None] = lambda text: None) -> Setting:
    """cell, wish, what hears how far the search is → problem.

    Raises InputError for a goal that these terms do not have, and where nothing can be touched.
    """
    say("what can be touched")
    terms = ("S4",) if wish.goal.word == "check" else wish.terms
    also = _visited(cell, wish.before) if wish.goal.word == "check" else ()
    choice = candidates.candidates(cell, terms, wish.approach, wish.degree, also=also)
    where = region.region(cell.machine, cell.artefact, wish.box)
    model = choice.selection.model
    lever = region.levers(cell.machine, model.coefficients, len(model.names), region.poses(cell.machine, where))
    seconds = 60 * (wish.minutes or goals.USUAL_MINUTES.get(wish.goal.word, 10.0))
    begin, full = prior.held(choice), None
    if wish.goal.word == "volume":
        criterion = goals.volume(lever, choice.scale)
        goals.refuse_unseen(wish.goal.word, choice, bool(np.any(criterion.spread)))
    elif wish.goal.word == "check":
        changing = _changing(wish, choice)
        before, full = _before(cell, wish, choice)
        choice = check.with_changes(choice, before, changing, wish.stylus)
        criterion, begin = check.worst_change(choice, lever), choice.held
        goals.refuse_unseen(wish.goal.word, choice, bool(np.any(criterion.worst)))
    elif wish.goal.word == "A":
        criterion = goals.every(choice)
    elif wish.goal.word == "condition":
        criterion = goals.ill_conditioned(choice)
    elif wish.goal.word == "D":
        criterion = goals.of_limits(choice, {})
    else:
        reach = float(np.linalg.norm(np.subtract(where.high, where.low))) / 2
        located = any(map(goals.is_location, model.coefficients)) or not goals.unseen_of_machine(choice)
        goals.refuse_unseen(wish.goal.word, choice, bool(wish.goal.limits) or located)
        limits = wish.goal.limits or goals.usual_limits(model, reach)
        criterion = goals.of_limits(choice, limits, seen=True)
    problem = Problem(choice, criterion, seconds, wish.feed, begin, gate=wish.gate, say=say)
    return Setting(wish, problem.of_time(seconds), lever, where, full)


def _visited(cell: Cell, before: Readings | None) -> list[dict[str, float]]:
    """→ indexations (rad) of the full run: there a check meets what was measured, not what error motions between predict."""
    if before is None:
        return [dict(i.position) for i in cell.strategy.indexations]
    names = [name for name in before.axes if name == "S" or name in cell.machine.rotary]
    columns = [before.axes.index(name) for name in names]
    places = np.round(np.degrees(before.position[:, columns]), DIGITS)
    return [dict(zip(names, np.radians(row).tolist(), strict=True)) for row in np.unique(places, axis=0)]


def _changing(wish: Wish, choice: Candidates) -> list[int]:
    """→ unknowns that a check takes for changed: those of its terms, and the stylus where it does not stay in the spindle."""
    few = {c.name for c in select(choice.selection.model.touches, wish.terms, wish.degree).model.coefficients}
    own = [j for j, c in enumerate(choice.selection.model.coefficients) if c.name in few]
    return [j for j in own if wish.stylus > 0 or not check.is_stylus(choice, j)]


def _before(cell: Cell, wish: Wish, choice: Candidates) -> tuple[Array, float | None]:
    """→ (p, p) information of the full run that the check rests on, its s: of readings, or of the cell's strategy as planned."""
    if wish.before is None and not cell.strategy.indexations:
        raise InputError(
            "--goal check: a check rests on a full run, and there is neither --readings of one nor a strategy of this cell; "
            "allowed: a strategy first, by 'tango design --goal volume -o strategy.yaml'"
        )
    if wish.before is None:
        made = plan(cell, "leave-out")
        rows, facets = timed.rows_of(choice, made), [touch.facet for touch in made.touches]
        full: float | None = sum(of_moves(made, wish.feed)) + proof(made, wish.gate, wish.feed)
    else:
        full = _lasted(wish.before)
        touches = replace(from_readings(cell.machine, cell.artefact, wish.before), artefact=choice.cell.artefact)
        facets = list(touches.facet)
        model = Model(touches, choice.selection.model.coefficients)
        place = {name: j for j, name in enumerate(choice.selection.model.names)}
        rows = np.zeros((len(touches), len(place)))
        rows[:, [place[name] for name in model.names]] = linearise(model, np.zeros(len(model.names)))[1]
        rows *= choice.scale
    return information(choice, facets, rows), full


def _lasted(before: Readings) -> float | None:
    """readings → s of the longest cycle in them, from the first touch to the last; None where they do not say it."""
    cycles = np.unique(np.column_stack([before.day, before.cycle]), axis=0)
    spans = [float(np.ptp(before.time[(before.day == day) & (before.cycle == cycle)])) for day, cycle in cycles]
    return max(spans, default=0.0) or None


def propose(ready: Setting) -> Chosen:
    """setting → plan. With limits and no time: the shortest plan that keeps them. Raises InputError where nothing does.

    A check without a stated time: of usual times the shortest that is worth making. Another goal: the usual time, or where that
    does not do, the first longer one that does.
    """
    usual = ready.wish.minutes is None and ready.wish.goal.word not in ("", "check")
    for tried in range(TRIES):
        try:
            return _proposed(ready)
        except InVain as error:
            minutes = error.minutes if usual and tried < TRIES - 1 else None
            if minutes is None:
                raise refused(ready, error) from None
            ready = replace(ready, problem=ready.problem.of_time(60 * minutes))
    raise AssertionError


def _proposed(ready: Setting) -> Chosen:
    """setting → plan. Raises InVain where none of its time does."""
    wish, problem = ready.wish, ready.problem
    if wish.minutes is None and not wish.goal.word:
        return shortest(problem)
    try:
        if wish.goal.word == "check" and wish.minutes is None:
            return worth_making(_usual_check(problem))
        found = choose.chosen(problem, early=bool(wish.goal.word), loss=wish.loss)
        return worth_making(found) if wish.goal.word or not determined(problem, found.information) else found
    except choose.TooShort as error:
        raise InVain(error.found, "even the shortest plan takes longer") from None
    except choose.Undetermined as error:
        raise InVain(error.found, undetermined(error.found)) from None
    except choose.TooFew as error:
        raise InVain(error.found, error.why, error.seconds / 60) from None


def _usual_check(problem: Problem) -> Chosen:
    """problem of a check → the plan of the usual time where it sees changes well, else of the shortest time in which one does."""
    found = choose.chosen(problem)
    if _well(problem, found.information):
        return found
    minutes = how_long.needed(found, _well, longest=CHECK) or CHECK
    return choose.chosen(problem.of_time(60 * minutes))


def _well(problem: Problem, information: Array) -> bool:
    """problem of a check, A (p, p) → whether it sees changes of about 20 µm."""
    return serves(problem, information) and problem.choice.sigma * value(problem.criterion, information) ** 0.5 < WELL


def same_time(ready: Setting, other: Cell, made: Plan) -> Chosen:
    """setting, cell with another strategy, its plan → what that is worth by the same criterion."""
    return timed.judged(ready.problem, other, made)


def reached(ready: Setting, phi: float, widens: float = 1.0) -> tuple[float, str]:
    """setting, φ, factor of standard deviations (`enough.widened`) → the number that the command prints, and its unit."""
    problem = ready.problem
    sigma = problem.choice.sigma
    if problem.criterion.determinant:
        return phi / len(problem.held), "(−log det per unknown)"
    if problem.criterion.name in ("volume", "check"):
        return 1e3 * sigma * widens * phi**0.5, "µm"
    if problem.criterion.name == "limits":
        return widens * phi**0.5, "of the limit"
    return sigma * widens * phi**0.5, "mm at a touch"


def std_of(ready: Setting, information: Array, widens: float = 1.0) -> dict[str, tuple[float, str]]:
    """setting, information, factor of standard deviations (`enough.widened`) → that of every coefficient in its own unit."""
    choice = ready.problem.choice
    sigma = choice.sigma
    std = sigma * widens * np.sqrt(np.diag(np.linalg.inv(information))) * choice.scale
    return {choice.selection.label(c.name): (float(std[j]), c.unit) for j, c in enumerate(choice.selection.model.coefficients)}


def most_uncertain(ready: Setting, information: Array) -> str | None:
    """setting, information → the coefficient that is farthest from its limit; None where the goal has no limits."""
    worst, choice = ready.problem.criterion.worst, ready.problem.choice
    if ready.problem.criterion.name != "limits" or worst is None:
        return None
    ratio = np.einsum("kp,pq,kq->k", worst, np.linalg.inv(information), worst)
    place = int(np.flatnonzero(worst[int(np.argmax(ratio))])[0])
    own = choice.selection.model.coefficients
    return choice.selection.label(own[place].name) if place < len(own) else None


def competitors(ready: Setting, found: Chosen) -> dict[str, float]:
    """setting, plan → φ of the regular plan of its time, and of the best of 100 random ones of as many touches and turns."""
    ready.problem.say("100 random plans, and the regular one")
    others = {"best of 100 random": float(plain.at_random(found).min())}
    with suppress(InputError):  # none fits into the time
        others["regular"] = plain.regular(
            replace(ready.problem, seconds=max(found.seconds, ready.problem.seconds), times=found.problem.times)
        ).value
    return others


def regular(ready: Setting) -> Chosen:
    """setting → the plain regular plan of its time."""
    return plain.regular(ready.problem)
