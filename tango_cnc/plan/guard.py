"""What is declared on the bodies of the machine (yoke, column, tool setter …): whether the moves of a plan keep off it.

While only linear axes move, two things are shifted past each other along a line, whatever bodies they are on: `check.apart` proves
how far they stay apart. While rotary axes turn, the angles that may be passed are cut into boxes: within a box nothing moves
farther than its lever times the angle, so distance at the middle decides, or the box is cut again. What is not proven is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..check.apart import Placed, Round, apart
from ..check.bodies import Pair, poses
from ..check.travel import ROUNDING
from ..records import Array, InputError, Machine, Move, Plan
from . import sweep
from .sweep import Spans

TOUCH, TRAVEL, TURN = range(3)  # which of `Pair.margins` counts
FINE = 0.5  # mm of motion within a box of angles: what is not proven by then is too near
MOST = 20_000  # boxes of one turn
CHUNK = 4096  # moves looked at at once
NOBODY = "Before the first touch nobody knows where the axes stand"
Rows = NDArray[np.integer]
Looked = dict[tuple[object, ...], bool]  # turn of a pair → whether it keeps off: plans of the same machine and table may share it
Faults = dict[int, str]  # number of a touch to which no safe way leads, one past the last for the parting retract → why not


class Guard:
    """One machine with what may meet what is declared on its bodies; without such a thing it finds nothing and costs nothing."""

    def __init__(self, machine: Machine, pairs: Sequence[Pair], looked: Looked | None = None) -> None:
        """machine, its pairs of things between which something moves; `looked`: turns that were looked at for the same ones."""
        self._machine, self.pairs = machine, tuple(pairs)
        self._known: Looked = {} if looked is None else looked

    def __bool__(self) -> bool:
        return bool(self.pairs)

    def meets(self, places: Array, margin: int) -> Rows:
        """(n, s, k) mm rad, rotary axes alike in all s, which margin → (n,) number of the first pair that comes too near, or −1."""
        found = np.full(len(places), -1)
        for number, pair in enumerate(self.pairs):
            rows = np.flatnonzero(found < 0)
            if not len(rows):
                break
            one, other = (poses(self._machine, axes, places[rows]) for axes in (pair.own, pair.others))
            clear = apart(pair.one.shape, one, pair.other.shape, other, np.full(len(rows), pair.margins[margin]))
            found[rows[~clear]] = number
        return found

    def turns(self, place: Array, within: Spans | None, probe_alone: bool = False) -> Pair | None:
        """(k,) mm rad, spans of the rotary axes or None for all angles → the first pair that comes too near while they turn.

        `probe_alone`: where nobody knows the angles, the probe is judged against what is not on its own side; of the rest, which
        may well meet at some angles, `anywhere` tells.
        """
        spans = within or everywhere(self._machine)
        checked = (pair for pair in self.pairs if pair.across or not probe_alone)
        return next((pair for pair in checked if not self._keeps(pair, place[None], spans, pair.margins[TURN])), None)

    def anywhere(self, place: Array, first: str) -> list[Pair]:
        """(k,) mm rad, axis that stands there → pairs that may meet while every other axis is anywhere within its travel."""
        free = [name for name in self._machine.linear if name != first]
        ends = [self._machine.axis(name).travel or (0.0, 0.0) for name in free]
        places = np.repeat(place[None], 2 ** len(free), axis=0)
        places[:, [self._machine.column(name) for name in free]] = list(product(*ends))
        spans = everywhere(self._machine)
        return [pair for pair in self.pairs if not self._keeps(pair, places, spans, pair.margins[TOUCH])]

    def _keeps(self, pair: Pair, places: Array, spans: Spans, need: float) -> bool:
        """pair, (s, k) between which the linear axes are, spans → whether it is proven to keep `need` mm."""
        linear = [self._machine.column(name) for name in pair.axes if self._machine.axis(name).kind == "linear"]
        angles = [spans[name] for name in pair.axes if name in spans]
        key = (pair.one.name, pair.other.name, *np.round(places[:, linear], 6).ravel().tolist(), *angles, need)
        if key not in self._known:
            self._known[key] = self._as_balls(pair, places, spans, need) or self._in_boxes(pair, places, spans, need)
        return self._known[key]

    def _as_balls(self, pair: Pair, places: Array, spans: Spans, need: float) -> bool:
        """The same with what turns as the ball that it sweeps at any angles: quick, and enough for what is far away."""
        sides = [(pair.one.shape, pair.own), (pair.other.shape, pair.others)]
        ball: list[Round] = []
        shift: list[Array] = []
        for shape, axes in sides:
            if any(name in spans for name in axes):
                swept = [sweep.sphere(self._machine, axes, place, (shape.corner, np.zeros(len(shape.corner)))) for place in places]
                ball.append(Round(np.zeros((1, 3)), max(radius for _, radius in swept) + shape.radius))
                shift.append(np.array([[centre for centre, _ in swept]]))
            else:
                ball.append(shape)
                shift.append(poses(self._machine, axes, places[None]).shift)
        one, other = (Placed(np.eye(3)[None], each) for each in shift)
        return bool(apart(ball[0], one, ball[1], other, np.array([need]))[0])

    def _in_boxes(self, pair: Pair, places: Array, spans: Spans, need: float) -> bool:
        turning = [name for name in pair.axes if name in spans]
        columns = [self._machine.column(name) for name in turning]
        lever = np.array([self._lever(pair, name, places) for name in turning])
        low, high = (np.array([[spans[name][end] for name in turning]]) for end in (0, 1))
        looked = 0
        while len(low):
            looked += len(low)
            if looked > MOST:
                return False
            at = np.repeat(places[None], len(low), axis=0)
            at[:, :, columns] = ((low + high) / 2)[:, None]
            one, other = (poses(self._machine, axes, at) for axes in (pair.own, pair.others))
            motion = (high - low) / 2 * lever
            moves = motion.sum(axis=1)
            clear = apart(pair.one.shape, one, pair.other.shape, other, need + moves)
            if clear.all():
                return True
            low, high, motion = low[~clear], high[~clear], motion[~clear]
            near = ~apart(*_rows(pair, one, other, ~clear), np.full(len(low), need))
            if near.any() or (motion.sum(axis=1) < FINE).any():
                return False
            row, widest = np.arange(len(low)), motion.argmax(axis=1)
            middle = (low + high)[row, widest] / 2
            upper, lower = low.copy(), high.copy()
            upper[row, widest] = lower[row, widest] = middle
            low, high = np.vstack([low, upper]), np.vstack([lower, high])
        return True

    def _lever(self, pair: Pair, name: str, places: Array) -> float:
        """pair, rotary axis, (s, k) → mm: nothing that it turns is farther from it."""
        axes, shape = (pair.own, pair.one.shape) if name in pair.own else (pair.others, pair.other.shape)
        return max(_lever(self._machine, axes, name, shape.corner, place) for place in places)


def _rows(pair: Pair, one: Placed, other: Placed, rows: NDArray[np.bool_]) -> tuple[Round, Placed, Round, Placed]:
    return pair.one.shape, Placed(one.turn[rows], one.shift[rows]), pair.other.shape, Placed(other.turn[rows], other.shift[rows])


def _lever(machine: Machine, axes: tuple[str, ...], name: str, points: Array, place: Array) -> float:
    """axes from the inner one outwards, one of them, (v, 3) mm → mm, how far from it any point gets, at any angles."""
    radius, points = np.zeros(len(points)), points.copy()
    for each in reversed(axes):
        axis = machine.axis(each)
        if axis.kind == "linear":
            points = points + place[machine.column(each)] * np.array(axis.direction)
            continue
        along, about = np.array(axis.direction), np.array(axis.point)
        foot = about + ((points - about) @ along)[:, None] * along
        radius = radius + np.linalg.norm(points - foot, axis=1)
        if each == name:
            return float(radius.max())
        points = foot  # whatever its angle, a point is that far from its foot on the axis
    raise AssertionError(name)


def everywhere(machine: Machine) -> Spans:
    """machine → rad between which each rotary axis may be."""
    return {name: _all_round(*machine.axis(name).limits) for name in machine.rotary}


def _all_round(low: float, high: float) -> tuple[float, float]:
    return (low, high) if high - low < math.tau else (-math.pi, math.pi)


def complaint(pair: Pair, margin: int) -> str:
    """pair, which margin → what it would do, in words."""
    return f"{pair.one.name} would come within {pair.margins[margin]:g} mm of {pair.other.name}"


def todo(pair: Pair) -> str:
    """pair → what to do about it."""
    if pair.one.probe:
        return "Turn the table otherwise, take the touch out, or correct the obstacle and 'on' in machine.yaml."
    return "Turn the table otherwise, take the indexation out, or correct both in their files: they keep that far from each other."


def refuse(plan: Plan, guard: Guard, faults: Faults | None = None) -> None:
    """plan, its guard → nothing. Raises InputError for the first of its moves that is not proven to keep off all obstacles.

    `faults`: takes all ways with such moves instead, besides those that are in it.
    """
    if not guard:
        return
    machine, at, begun, leads = plan.machine, dict[str, float](), False, _leads(plan)
    before, rows, said = "", list[tuple[int, tuple[float, ...], tuple[float, ...]]](), list[tuple[Move, int]]()
    back = -1  # the touch that has just been made
    for move in plan.moves:
        known = len(at) == len(machine.names)
        start = tuple(at.get(name, math.nan) for name in machine.names)
        at.update(move.target)
        end = tuple(at.get(name, math.nan) for name in machine.names)
        number = leads[back] if move.touch == back else move.touch
        if faults is not None and number in faults:
            pass
        elif move.kind == "index":
            within = sweep.spans(machine, np.array(start), np.array(end)) if known else None
            if (pair := guard.turns(np.array(end), within, probe_alone=not begun)) is not None:
                _note(plan, move, number, pair, TURN, faults)
        elif known:
            close = move.kind not in ("clear", "retract") or (move.kind == "retract" and before == "back")
            rows.append((TOUCH if close else TRAVEL, start, end))
            said.append((move, number))
        before, begun = move.kind, begun or move.kind == "approach"
        back = move.touch if move.kind == "back" else back
        if len(rows) >= CHUNK:
            _refuse(plan, guard, rows, said, faults)
            rows, said = [], []
    _refuse(plan, guard, rows, said, faults)


def _leads(plan: Plan) -> dict[int, int]:
    """plan → number of a touch → of the one to which the way from it leads; after the last one, one more."""
    numbers = [touch.number for touch in plan.touches]
    return dict(zip(numbers, [*numbers[1:], numbers[-1] + 1], strict=True))


def _refuse(
    plan: Plan,
    guard: Guard,
    rows: Sequence[tuple[int, tuple[float, ...], tuple[float, ...]]],
    said: Sequence[tuple[Move, int]],
    faults: Faults | None,
) -> None:
    margin = np.array([row[0] for row in rows])
    for which in (TOUCH, TRAVEL):
        some = np.flatnonzero(margin == which)
        if len(some):
            found = guard.meets(np.array([rows[i][1:] for i in some.tolist()]), which)
            for i in np.flatnonzero(found >= 0).tolist():
                _note(plan, *said[int(some[i])], guard.pairs[int(found[i])], which, faults)


def _note(plan: Plan, move: Move, number: int, pair: Pair, margin: int, faults: Faults | None) -> None:
    """Raises InputError, or notes the fault of the way to that touch."""
    error = _refused(plan, move, pair, margin)
    if faults is None:
        raise error
    faults.setdefault(number, str(error))


def _refused(plan: Plan, move: Move, pair: Pair, margin: int) -> InputError:
    touch = next(touch for touch in plan.touches if touch.number == move.touch)
    position = plan.strategy.indexations[touch.indexation].position
    pose = " ".join(f"{name} {math.degrees(position.get(name, 0.0)):g}" for name in (*plan.machine.rotary, "S"))
    way = {"index": "while the axes turn before", "clear": "on the way to", "retract": "on the way up at"}.get(move.kind, "at")
    return InputError(
        f"{plan.strategy.name}: {way} touch {touch.number} (facet {touch.facet}, indexation {touch.indexation + 1}: {pose}) "
        f"{complaint(pair, margin)}. {todo(pair)}"
    )


def remarks(machine: Machine, guard: Guard, place: Iterable[float], first: str) -> tuple[str, ...]:
    """machine, guard, where the rotary axes turn first, axis that goes there alone before all others → what a person has to see to.

    The way there from where the axes stand is proven for every place that they may stand at, or is named here.
    """
    where = np.array(tuple(place))
    names: Mapping[str, list[str]] = {}
    for pair in guard.anywhere(where, first):
        names = {**names, pair.other.name: [*names.get(pair.other.name, []), pair.one.name]}
    if not names:
        return ()
    goal = " ".join(
        f"{name} {value if machine.axis(name).kind == 'linear' else math.degrees(value):.1f}"
        for name, value in zip(machine.names, where.tolist(), strict=True)
        if name not in (first, "S")
    )
    said = "; ".join(f"{other} may be met by {', '.join(ones)}" for other, ones in names.items())
    return (f"{NOBODY}. On the way to the first place ({goal}) {said}. Bring the axes near that place before you start.",)


def outside(machine: Machine, place: Array) -> bool:
    """machine, (k,) mm rad → whether an axis would be beyond its travel."""
    limits = [axis.limits for axis in machine.axes]
    return any(not low - ROUNDING <= value <= high + ROUNDING for (low, high), value in zip(limits, place.tolist(), strict=True))
