"""The touches of a short check: those of the cell's strategy that tell soonest which parts of a compensation are in the control.

Every touch of the strategy is one that can be made, and its facet is known from the full run. So a check is a choice of these, in
their order: one after the other that touch is taken that lowers the variances of the shares (`shares.py`) most for its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..design.order import again
from ..duration import of_moves, proof
from ..plan import last_motion, plan
from ..records import Array, Cell, InputError, Plan
from ..touches import Touches, of_facets
from .fit import posed
from .promise import Figure
from .rows import TableRows, added, rows_of
from .seen import WITHIN, asked_for
from .shares import Part, System, apart, foreseen, system
from .short import WHOLE, Short, changes, levers_of
from .space import Poses
from .warmth import MAYBE

GOAL = 0.2  # standard deviation of a share
TELLS = 0.25  # standard deviation by the whole strategy: a file that this tells less of is not asked for
FEWEST = 16  # touches: fewer show nothing that does not fit
USUAL, LONGEST = 5.0, 8.0  # minutes at most, where nobody states a time
DECIDES, BETTER = 0.25, 0.95  # standard deviation that decides; of what is left open, what the longer ones have to reach
FOR_ROWS = 1.0  # of these for rows of tables that none of the touches meets
NEARLY = 0.9  # of the best gain a second: of touches as good as that the one is taken that meets most such rows
ROW = 3  # touches of a facet in a row, at most
AT_ONCE = 8  # touches that are weighed together at a place the check has not come to
TRIES, LESS = 10, 0.96  # plans that are made at most; of the time that seems to be right, where one took too long
FULL = 0.93  # of the time: more of it is not looked for
INDEXATIONS = 3  # at least, that a check goes to: of fewer an axis that turned has hardly any say

Count = NDArray[np.int64]


@dataclass(frozen=True)
class Costs:
    """Seconds of a touch with its way, of the same once more, and (m,) of coming to each indexation."""

    touch: float
    again: float
    turns: Array


@dataclass(frozen=True)
class Look:
    """Touches of a short check, and what they will tell."""

    cell: Cell
    plan: Plan
    seconds: float
    names: tuple[str, ...]  # of the files that the strategy can tell, of the parts that matter, and `WHOLE`
    std: tuple[float, ...]  # of the share of each
    small: tuple[str, ...]  # files, and parts of files, that it does not ask for
    grown: float | None = None  # K, standard deviation to which it tells what all axes have grown alike; None: no touch tells it
    chosen: Count | None = None  # (n,) of the touches of the strategy: how often each is made
    numbers: tuple[int, ...] = ()  # of the touches of the strategy
    tables: tuple[TableRows, ...] = ()  # what every touch of the strategy feels of the rows of tables that were written

    @property
    def made(self) -> list[int]:
        """→ touches of the strategy that it makes."""
        return [] if self.chosen is None else np.flatnonzero(self.chosen).tolist()

    @property
    def open(self) -> float:
        """→ how much it leaves open: the sum of what is to be known, each not better than it has to be."""
        warm = () if self.grown is None else (self.grown / MAYBE,)
        return sum(max(std, GOAL) for std in (*warm, *self.std))

    @property
    def undecided(self) -> tuple[str, ...]:
        """→ names of those of which it does not tell whether they act."""
        return tuple(name for name, std in zip(self.names, self.std, strict=True) if std > 1 / WITHIN)


def look(
    asked: Short,
    cell: Cell,
    before: Figure,
    feed: float | None,
    gate: str,
    minutes: float | None = None,
    goal: float = 0.0,
    *,
    rows: bool = False,
) -> Look:
    """short check, cell with the strategy to choose from, µm before, mm/min of protected moves, gate, minutes at most → touches.

    `goal`: with minutes, the standard deviation of a share that does; the check takes no longer then. Else the time that is left
    goes to touches that meet more rows of tables. `rows`: to all that the strategy meets, however long they take.

    Raises InputError where nothing that changed is seen by touches like these.
    """
    made = plan(cell, "leave-out")
    machine = cell.machine
    position = np.array([touch.contact for touch in made.touches])
    touches = of_facets(machine, cell.artefact, [t.facet for t in made.touches], position, last_motion(made))
    parts, at = asked.parts, asked.poses
    if not parts:
        raise InputError(
            f"--short-check: found compensation {asked.kept.number}, which changes kinematics alone: touches without tool center "
            "point control do not see them; allowed: --tcp, for a program that runs with it on"
        )
    where = np.array([touch.indexation for touch in made.touches])
    touch, turns = _costs(made, where, feed)
    costs = Costs(touch, min(again(cell, feed), touch), turns)
    warm = _warm(asked, touches, parts)
    if warm is not None:
        asked = replace(asked, before=replace(asked.before, grown=MAYBE))
    aims = _aims(asked, touches, parts, at, before)
    every = (*(() if warm is None else (warm,)), *(aim for aim, _, _ in aims))
    tables = rows_of(asked.held, changes(asked.kept), touches, at)
    meets = np.concatenate([np.zeros((len(touches), 0), dtype=np.bool_), *(one.meets for one in tables)], axis=1)
    job = _Job(cell, made, feed, proof(made, gate, feed), every, where, costs, warm is not None, meets)
    words = tuple(name for _, names, _ in aims for name in names), tuple(name for _, _, small in aims for name in small)
    # Whoever states a time wants to know as much as that allows.
    found = job.made_of(60 * minutes, goal, *words) if minutes else _soonest(job, words)
    found = replace(found, numbers=tuple(t.number for t in made.touches), tables=tables)
    others = added(found.tables, found.made)
    if rows:
        return job.also(found, others)
    return found if goal else job.filled(found, others, 60 * (minutes or LONGEST))


def _soonest(job: _Job, words: tuple[tuple[str, ...], tuple[str, ...]]) -> Look:
    """what is chosen from, names of what is to be known and of what is not → the touches of a check whose time nobody states."""
    longer = job.made_of(60 * (LONGEST - (FOR_ROWS if job.meets.any() else 0.0)), GOAL, *words)
    if longer.seconds <= 60 * USUAL:
        return longer
    try:
        found = job.made_of(60 * USUAL, GOAL, *words)
    except InputError:  # turns take too long for it
        return longer
    poor = max(found.std) > DECIDES or (found.grown or 0.0) > MAYBE * DECIDES
    return longer if poor and longer.open < BETTER * found.open else found


@dataclass(frozen=True)
class _Aim:
    """One way to divide a compensation, and what of it is to be known."""

    rows: Array  # (n, q) of every touch, in what is independent before them, in standard deviations
    wanted: Array  # (k, q) of that

    @classmethod
    def of(cls, ready: System, sigma: float, wanted: Array) -> _Aim:
        """system, mm of a touch, (k, q) what is to be known → the same in what is independent before the touches."""
        return cls(ready.rows @ ready.root / sigma, wanted @ ready.root)


def _warm(asked: Short, touches: Touches, parts: Sequence[Part]) -> _Aim | None:
    """short check, touches to choose from, parts → what all axes have grown alike, as an aim; None where no touch tells it.

    To 1 K it is as well known as a share to `GOAL`.
    """
    ready = system(replace(asked.before, grown=MAYBE), touches, parts)
    wanted = np.zeros((1, len(ready.root)))
    wanted[0, ready.places] = 1 / MAYBE
    aim = _Aim.of(ready, asked.before.sigma, wanted)
    return aim if _after(aim, aim.rows)[0] <= TELLS else None


def _aims(
    asked: Short, touches: Touches, parts: Sequence[Part], at: Poses, before: Figure
) -> list[tuple[_Aim, tuple[str, ...], tuple[str, ...]]]:
    """short check, touches to choose from, parts, poses, µm before → aims, with names of what is to be known and what is not.

    Files first: each that the whole strategy would tell, however little it takes away. Then tables of them that matter.
    """
    question, sigma = asked.question(parts), asked.before.sigma
    found, known = [], set[frozenset[str]]()
    if question.loads:
        ready = system(asked.before, touches, question.loads)
        tells = np.array(told_by(asked, touches, question.loads, question.sizes(question.loads), before))
        wanted = _shares_of(ready, tells)
        names = np.array([part.name for part in question.loads])
        found.append((_Aim.of(ready, sigma, wanted), tuple(names[tells].tolist()), tuple(names[~tells].tolist())))
        known = {frozenset(h.place for h in part.held) for part, t in zip(question.loads, tells, strict=True) if t}
    alone = np.array([frozenset(h.place for h in part.held) in known for part in parts])  # a file of one table
    sizes = question.sizes(parts)
    matter = np.array([asked_for(size, before, sigma) for size in sizes])
    if not matter.any():
        matter[int(np.argmax(sizes))] = True
    ready = system(asked.before, touches, parts)
    wanted = np.vstack([_shares_of(ready, matter & ~alone), _whole(asked, ready, at)])
    names = np.array([part.name for part in parts])
    unasked = {name for _, _, small in found for name in small}
    dim = np.array([not {question.held_in.get(h.place) for h in part.held} <= unasked for part in parts])  # else the file says it
    named = (*names[matter & ~alone].tolist(), WHOLE), tuple(names[~matter & ~alone & dim].tolist())
    return [*found, (_Aim.of(ready, sigma, wanted), *named)]


def told_by(asked: Short, touches: Touches, loads: Sequence[Part], sizes: Sequence[float], before: Figure) -> list[bool]:
    """short check, touches to choose from, files, µm rms that each takes away, µm before → of each whether it is asked for.

    Those that all touches tell well, and of what takes much away also those that they decide.
    """
    std = np.sqrt(np.diag(foreseen(asked.before, touches, loads)))
    limit = [1 / WITHIN if asked_for(size, before, asked.before.sigma) else TELLS for size in sizes]
    return [bool(s <= most) for s, most in zip(std, limit, strict=True)]


def _shares_of(ready: System, which: NDArray[np.bool_]) -> Array:
    """system, (g,) which parts → (k, q) their shares."""
    found = np.zeros((int(which.sum()), len(ready.root)))
    found[np.arange(len(found)), np.flatnonzero(which) + len(ready.root) - len(which)] = 1.0
    return found


@dataclass(frozen=True)
class _Job:
    """All that a choice of touches needs."""

    cell: Cell
    made: Plan
    feed: float | None
    alive: float  # s that it takes to prove the probe alive
    aims: tuple[_Aim, ...]
    where: Count
    costs: Costs
    warm: bool  # whether the first aim is what all axes have grown
    meets: NDArray[np.bool_]  # (n, r) whether a touch meets a row of a table

    def made_of(self, seconds: float, goal: float, names: tuple[str, ...], small: tuple[str, ...]) -> Look:
        """s at most, standard deviation that does, names of what is to be known and of what is not → the touches."""
        most, least, longest = seconds - self.alive, 0.0, np.inf
        best: Look | None = None
        for _ in range(TRIES):  # what turns take is known when they are planned
            chosen = _chosen(self.aims, self.where, self.costs, most, goal, self.meets)
            if not chosen.any():
                if not np.isfinite(longest):
                    break
                least, most = most, (most + longest) / 2
                continue
            found = _with(self.cell, self.made, chosen)
            planned = plan(found, "leave-out")
            takes = self.alive + sum(of_moves(planned, self.feed))
            if takes > seconds:
                longest = most
                most = max(LESS * most * seconds / takes, (least + most) / 2 if best else 0.0)
                continue
            std = _std(self.aims, chosen)
            grown, std = (MAYBE * float(std[0]), std[1:]) if self.warm else (None, std)
            made = Look(found, planned, takes, names, tuple(std.tolist()), small, grown, chosen)
            best = made if best is None or made.open < best.open else best
            known = max(made.std) <= goal and (made.grown or 0.0) <= max(goal, GOAL) * MAYBE
            if known or takes > FULL * seconds or not np.isfinite(longest):
                break
            least, most = most, (most + longest) / 2
        if best is None:
            raise InputError(f"--minutes: found {seconds / 60:.3g}, in which no check can be made; allowed: more time")
        return best

    def also(self, found: Look, rows: Sequence[int]) -> Look:
        """touches of a check, rows of touches that are made as well → the check with both."""
        if not rows or found.chosen is None:
            return found
        chosen = found.chosen.copy()
        chosen[list(rows)] = np.maximum(chosen[list(rows)], 1)
        cell = _with(self.cell, self.made, chosen)
        planned, std = plan(cell, "leave-out"), _std(self.aims, chosen)
        grown, std = (MAYBE * float(std[0]), std[1:]) if self.warm else (None, std)
        takes = self.alive + sum(of_moves(planned, self.feed))
        made = replace(found, cell=cell, plan=planned, seconds=takes, chosen=chosen)
        return replace(made, std=tuple(std.tolist()), grown=grown)

    def filled(self, found: Look, rows: Sequence[int], seconds: float) -> Look:
        """touches of a check, rows of touches that meet more rows of tables, s at most → the check with as many of these as there
        is time for, those that meet most first."""
        fits, most = 0, len(rows)
        best = found
        while fits < most:  # a plan says what they take: halved until no more fit
            count = (fits + most + 1) // 2
            made = self.also(found, rows[:count])
            if made.seconds <= seconds:
                fits, best = count, made
            else:
                most = count - 1
        return best


def _whole(asked: Short, ready: System, at: Poses) -> Array:
    """short check, its system, poses → (q,) what of all that the compensation takes away, seen together, each unknown makes."""
    model = asked.before.result.model
    own = [j for j, c in enumerate(model.coefficients) if posed(c, at.touches)]
    moved = at.free(np.stack([part.moved(at).ravel() for part in asked.parts], axis=1))
    whole = moved.sum(axis=1)
    found = np.zeros(len(ready.root))
    found[own] = -(whole @ at.free(levers_of(model, own, at))) / float(whole @ whole)
    found[-len(asked.parts) :] = whole @ moved / float(whole @ whole)
    return found


def _costs(made: Plan, where: Count, feed: float | None) -> tuple[float, Array]:
    """plan, indexation of every touch → s of a touch with its way, (m,) s of coming to each indexation."""
    spent = np.zeros(len(where))
    turning = np.zeros(int(where.max()) + 1)
    row = {touch.number: i for i, touch in enumerate(made.touches)}
    first = np.r_[True, np.diff(where) != 0]
    for move, seconds in zip(made.moves, of_moves(made, feed), strict=True):
        i = row[move.touch]
        if first[i] and move.kind in ("retract", "clear", "index"):
            turning[where[i]] += seconds
        else:
            spent[i] += seconds
    return float(np.mean(spent)), turning


def _chosen(aims: Sequence[_Aim], where: Count, costs: Costs, seconds: float, goal: float, meets: NDArray[np.bool_]) -> Count:
    """what is to be known of all touches, their indexations, costs, s, goal, rows that they meet → (n,) how often each is made.

    Where the probe is already one touch more is weighed; elsewhere as many together as are worth the turn.
    """
    draft = _Draft(tuple(aims), tuple(np.eye(aim.rows.shape[1]) for aim in aims), np.zeros_like(where), goal, meets)
    visited: set[int] = set()
    while True:
        enough = draft.worst <= goal and draft.count.sum() >= FEWEST and len(visited) >= min(INDEXATIONS, len(costs.turns))
        best: tuple[float, list[int], float] | None = None
        at = -1
        for place in () if enough else range(len(costs.turns)):
            turn = 0.0 if place in visited else float(costs.turns[place])
            found = draft.best_of(np.flatnonzero(where == place), costs, turn, seconds)
            if found is not None and (best is None or found[0] > best[0]):
                best, at = found, place
        if best is None:
            return draft.count
        _, touches, price = best
        for touch in touches:
            draft = draft.more(touch)
        visited.add(at)
        seconds -= price


@dataclass(frozen=True)
class _Draft:
    """Touches in what is independent before them, shares that are to be known, the covariance after those chosen so far."""

    aims: tuple[_Aim, ...]
    covariance: tuple[Array, ...]  # (q, q) of each
    count: Count  # (n,) how often each is made
    goal: float
    meets: NDArray[np.bool_]  # (n, r) whether a touch meets a row of a table

    @property
    def worst(self) -> float:
        """→ largest standard deviation of a share that matters."""
        return float(_stds(self.aims, self.covariance).max())

    @cached_property
    def seen(self) -> tuple[tuple[Array, Array, Array], ...]:
        """→ of each aim what every place asks for: (n, q) covariances of the touches with all, (n, k) with what is to be known,
        (k,) variances of that."""
        by = [aim.rows @ c for aim, c in zip(self.aims, self.covariance, strict=True)]
        told = (np.sum((aim.wanted @ c) * aim.wanted, axis=1) for aim, c in zip(self.aims, self.covariance, strict=True))
        return tuple((b, b @ aim.wanted.T, v) for aim, b, v in zip(self.aims, by, told, strict=True))

    def more(self, touch: int) -> _Draft:
        """number of a touch → the draft with it."""
        count, after = self.count.copy(), []
        count[touch] += 1
        for aim, covariance in zip(self.aims, self.covariance, strict=True):
            by = covariance @ aim.rows[touch]
            after.append(covariance - by[:, None] * (by / (1.0 + float(by @ aim.rows[touch]))))
        return replace(self, covariance=tuple(after), count=count)

    def pick(self, count: Count, free: Count, value: Array) -> int:
        """how often each is made, touches that are free, gain a second of each → which of them: of those nearly as good as the best
        the one that meets most rows of tables that none of those made meets."""
        best = float(value.max())
        unmet = ~self.meets[count > 0].any(axis=0)
        rows = np.where(value >= NEARLY * best, self.meets[free][:, unmet].sum(axis=1), -1)
        return int(np.lexsort((value, rows))[-1])

    def best_of(self, own: Count, costs: Costs, turn: float, seconds: float) -> tuple[float, list[int], float] | None:
        """touches of one place, costs, s of coming there, s that are left → gain a second, touches to make, s; None: no time.

        A touch changes what the others of its place tell. So it is enough to follow the covariances of these with each other and
        with what is to be known.
        """
        ways = [[b[own] @ aim.rows[own].T, a[own], v] for aim, (b, a, v) in zip(self.aims, self.seen, strict=True)]
        count, price, total, best = self.count.copy(), turn, 0.0, None
        taken: list[int] = []
        for _ in range(AT_ONCE if turn else 1):
            each = np.where(count[own] > 0, costs.again, costs.touch)
            free = np.flatnonzero((count[own] < ROW) & (each <= seconds - price))
            if not len(free):
                break
            gain = np.zeros(len(free))
            for mutual, along, variance in ways:
                # A variance below the goal counts less than one above it: more of it helps nobody.
                weight = np.maximum(variance, 0.05 * max(self.goal, 0.05) ** 2)
                gain += (along[free] ** 2 / (1.0 + np.diag(mutual)[free])[:, None]) @ weight
            at = self.pick(count, own[free], gain / each[free])
            total, price = total + float(gain[at]), price + float(each[free[at]])
            i = int(free[at])
            count[own[i]] += 1
            taken.append(int(own[i]))
            for way in ways:
                mutual, along, variance = way
                b, a, lever = mutual[i], along[i], 1.0 + mutual[i, i]
                way[:] = mutual - np.outer(b, b) / lever, along - np.outer(b, a) / lever, variance - a**2 / lever
            if best is None or total / price > best[0]:
                best = total / price, list(taken), price
        return best


def _after(aim: _Aim, rows: Array) -> Array:
    """what is to be known, rows of touches → (k,) standard deviations after them."""
    covariance = np.linalg.inv(np.eye(rows.shape[1]) + rows.T @ rows)
    return np.asarray(np.sqrt(np.sum((aim.wanted @ covariance) * aim.wanted, axis=1)))


def _std(aims: Sequence[_Aim], chosen: Count) -> Array:
    """what is to be known, how often each touch is made → (k,) standard deviations of all of it."""
    every = [np.repeat(aim.rows, chosen, axis=0) for aim in aims]
    return _stds(aims, [np.asarray(np.linalg.inv(np.eye(rows.shape[1]) + rows.T @ rows)) for rows in every])


def _stds(aims: Sequence[_Aim], covariance: Sequence[Array]) -> Array:
    """what is to be known, covariance of each → (k,) standard deviations of telling each from none; of all together at the end."""
    found = [aim.wanted @ c @ aim.wanted.T for aim, c in zip(aims, covariance, strict=True)]
    last = found.pop()
    return np.concatenate([*(apart(c) for c in found), apart(last[:-1, :-1]), last[-1:, -1] ** 0.5])


def _with(cell: Cell, made: Plan, chosen: Count) -> Cell:
    """cell, its plan, how often each touch is made → the cell with these alone, in their order."""
    indexations = []
    for number, indexation in enumerate(cell.strategy.indexations):
        own = [(t.facet, n) for t, n in zip(made.touches, chosen, strict=True) if t.indexation == number]
        facets = tuple(facet for facet, n in own for _ in range(n))
        if facets:
            indexations.append(replace(indexation, facets=facets))
    return replace(cell, strategy=replace(cell.strategy, name="short check", indexations=tuple(indexations)))
