"""Motions read out of a program against those of its plan: each must be the next one, within the travels, and free.

Positions are those commanded, in machine coordinates, mm and degrees. Before the first motion of an axis it stands anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import check, kinematics
from ..gate import gate, served
from ..records import OFF, Array, Axis, InputError, Move, Plan, Touch
from .beside import STRAIGHT, TURNING, Beside, turn
from .switches import Switches

CLOSE = 6e-4  # mm or deg: programs have three decimals
AIR = 1.0  # mm between the probe and everything on the table while rotary axes turn: less than any planner leaves
STEP = 5.0  # deg between the poses of a turn that are looked at
SPACING = 10.0  # mm between the spheres that stand for the probe
BEHIND = 300.0  # mm of what carries the probe

ROUNDED = 0.01  # mm: the way off a facet is written axis by axis, with two decimals where an interpreter is short of room
FARTHEST, LEAST = OFF + ROUNDED, OFF - ROUNDED  # mm off a facet without a guard: what the planner keeps free, and no more
ALONG = math.cos(math.radians(2.0))

PROTECTED = ("retract", "clear", "approach", "near", "off", "back")
MEASURES = ("find", "probe")


class Walk:
    """One plan, as far as a program has carried it out."""

    def __init__(self, plan: Plan, options: Mapping[str, Any]) -> None:
        """plan, options of its profile → nothing has moved yet."""
        self._plan, self._moves = plan, served(plan, str(options.get("gate", "none")))
        self._switched = Switches(options)
        self._touch, self._number = plan.touches[0], -1  # which move is due
        self.next: Move | None = None
        self._advance()
        self._chain, self._solid = kinematics.chain(plan.machine), check.solid(plan.artefact)
        self._beside, self._descended = Beside(plan.machine, plan.artefact), False
        self.at = {axis.name: _anywhere(axis) for axis in plan.machine.axes}
        self._known: set[str] = set()
        self._turning: dict[str, float] = {}  # what is left of the indexation that is under way
        self._orients = len({touch.standoff[plan.machine.column("S")] for touch in plan.touches}) > 1
        self._gate = gate(plan) if options.get("gate") == "finger" else None  # what is still to prove the probe alive
        self._up = False  # the slow move has been made, and has not gone back yet

    @property
    def proving(self) -> bool:
        """→ whether the next motion has to be the one that proves the probe alive: before the first descent."""
        if self.on_facet:
            return True
        return self._gate is not None and not self._up and self._number == self._gate.before

    @property
    def on_facet(self) -> bool:
        """→ whether the next motion has to be the short search that proves the probe at a facet."""
        return self.next is not None and self.next.kind == "prove"

    def proof(self, target: Mapping[str, float], feed: float) -> None:
        """{X Y Z: mm}, mm/min → the probe has been touched half way there. Raises InputError when the motion is wrong."""
        self._settled()
        self._switched.moves()
        if self.on_facet:
            if abs(feed - self._plan.strategy.approach.feed) > 1e-6:
                raise InputError(f"the feed is {feed:g}; allowed: {self._plan.strategy.approach.feed:g} mm/min, at the facet")
            self._arrives(target)
            return
        assert self._gate is not None
        end, start = self.place(self._gate.end), self.place(self._gate.start)
        if abs(feed - self._gate.feed) > 1e-6:
            raise InputError(f"the feed is {feed:g}; allowed: {self._gate.feed:g} mm/min, while somebody touches the stylus")
        for name, value in target.items():
            if not abs(value - end[name]) <= CLOSE:
                raise InputError(f"found {name} {value:.3f} mm; the move that proves the probe goes to {name} {end[name]:.3f} mm")
            self._travel(name, value)
        self._keeps_off(target, "the slow move that proves the probe")
        self.at.update({name: (start[name] + end[name]) / 2 for name in target})
        self._up = True

    def _down(self, target: Mapping[str, float], kinds: tuple[str, ...]) -> None:
        """The guarded way back to where the slow move began. Raises InputError when it is wrong."""
        assert self._gate is not None
        start = self.place(self._gate.start)
        if set(kinds) & set(MEASURES):
            raise InputError("found a measuring move; the slow move that proves the probe has to go back first, guarded")
        for name, value in target.items():
            if not abs(value - start[name]) <= CLOSE:
                raise InputError(f"found {name} {value:.3f} mm; the slow move goes back to {name} {start[name]:.3f} mm first")
        self.at.update(target)
        self._gate, self._up = None, False

    def steps(self, name: str, by: float) -> None:
        """axis letter, mm → the step before all else has been made, with the probe on."""
        self._switched.moves()
        self.at[name] += by

    @property
    def touch(self) -> Touch:
        """→ the touch that the next motion serves."""
        return self._touch

    def _advance(self) -> None:
        """The next motion of the plan is due, with the touch that it serves."""
        due, self._number = next(self._moves, None), self._number + 1
        self.next = None if due is None else due[0]
        if due is not None:
            self._touch = due[1]

    @property
    def measures(self) -> bool:
        """→ whether the next motion is a measuring one, or the one that proves the probe alive."""
        return self.proving or self._measures

    @property
    def _measures(self) -> bool:
        return not self._up and self.next is not None and self.next.kind in MEASURES

    def place(self, positions: tuple[float, ...]) -> dict[str, float]:
        """positions of the plan (mm, rad) → {axis letter: mm or deg}."""
        return {a.name: _unit(a, v) for a, v in zip(self._plan.machine.axes, positions, strict=True)}

    def switch(self, word: str) -> None:
        """A word of the profile that switches the probe or a clamp; any other does nothing."""
        self._switched.switch(word)

    def linear(self, target: Mapping[str, float], kinds: tuple[str, ...]) -> None:
        """{X Y Z: mm}, kinds of moves that what protects this one is good for → it is done. Raises InputError when it is wrong."""
        self._settled()
        self._switched.moves()
        if self._up:
            self._down(target, kinds)
            return
        if self.proving:
            raise InputError("descends before anything has proven the probe alive; see gate in docs/dialects.md")
        move = self._due(target)
        if move.kind not in kinds:
            asked = {"probe": "a measuring move", "find": "a measuring move that finds", "index": "an indexation"}.get(
                move.kind, f"a protected move ({move.kind})"
            )
            raise InputError(f"found a {'measuring' if set(kinds) <= set(MEASURES) else 'linear'} move; the plan has {asked} here")
        self._arrives(target)

    def _arrives(self, target: Mapping[str, float]) -> None:
        """The move that is due has been made, a measuring one to its contact. Raises InputError when it goes elsewhere."""
        move = self._due(target)
        for name, value in target.items():
            wanted = move.target.get(name, self.at[name])
            if not abs(value - wanted) <= CLOSE:
                raise InputError(
                    f"found {name} {value:.3f} mm; the plan goes to {name} {wanted:.3f} mm ({move.kind}, touch {move.touch})"
                )
            self._travel(name, value)
        self._keeps_off(target, f"the {move.kind} move of touch {move.touch}")
        self._descended |= move.kind == "approach"
        self.at.update(target)
        self._known.update(move.target)
        if move.kind in (*MEASURES, "prove"):
            contact = self.place(self.touch.contact)
            self.at.update({name: contact[name] for name in target})
        self._advance()

    def off(self, step: Mapping[str, float]) -> float:
        """{axis letter: mm} right after a measuring move, where nothing guards → mm. Raises InputError when it is wrong."""
        touch, machine = self.touch, self._plan.machine
        away = {name: touch.standoff[machine.column(name)] - touch.contact[machine.column(name)] for name in machine.linear}
        length, way = math.hypot(*step.values()), math.hypot(*away.values())
        along = sum(value * away[name] for name, value in step.items())
        if not LEAST <= length <= FARTHEST or along < ALONG * length * way:
            raise InputError(f"found an unprotected move of {length:.3f} mm; allowed: {OFF:g} mm straight off the facet")
        return length

    def rotary(self, name: str, value: float) -> bool:
        """axis letter, deg → it is turned; whether an indexation begins with it. Raises InputError when it is wrong."""
        self._switched.turns(name)
        begins = not self._begun()
        if begins:
            self._begin(name, value)
        if name not in self._turning:
            raise InputError(f"found {name} {value:g}; the plan does not turn {name} here")
        wanted = self._turning.pop(name)
        if not abs(math.remainder(value - wanted, 360.0)) <= CLOSE:
            raise InputError(f"found {name} {value:g} deg; the plan turns to {name} {wanted:g} deg")
        if name != "S":
            self._travel(name, value)
            self._free(name, wanted)
        self.at[name] = wanted
        self._known.add(name)
        return begins

    def ends(self) -> None:
        """The program is over. Raises InputError when the plan is not."""
        self._settled()
        self._switched.ends()
        if self.next is not None:
            raise InputError(f"the program ends before the {self.next.kind} move of touch {self.next.touch}")

    def _begun(self) -> bool:
        return any(name != "S" or self._orients for name in self._turning)

    def _begin(self, name: str, value: float) -> None:
        move = self._due({name: value})
        if move.kind != "index":
            raise InputError(f"found {name} {value:g} turned; the plan has the {move.kind} move of touch {move.touch} here")
        self._turning = self.place_of(move.target)
        self._advance()

    def place_of(self, target: Mapping[str, float]) -> dict[str, float]:
        """{axis letter: mm or rad} → {axis letter: mm or deg}."""
        return {name: _unit(self._plan.machine.axis(name), value) for name, value in target.items()}

    def _due(self, target: Mapping[str, float]) -> Move:
        if self.next is None:
            raise InputError(f"found a move to {_spelt(target)}; the plan is over here")
        return self.next

    def _settled(self) -> None:
        """Raises InputError when an indexation is not complete. A spindle that only ever stands one way need not be turned."""
        if self._begun():
            raise InputError(f"the indexation lacks {' '.join(sorted(self._turning))}")
        if "S" in self._turning:
            self.at["S"] = self._turning.pop("S")

    def _travel(self, name: str, value: float) -> None:
        axis = self._plan.machine.axis(name)
        if axis.travel is not None:
            low, high = (_unit(axis, v) for v in axis.travel)
            if not low - CLOSE <= value <= high + CLOSE:
                raise InputError(f"found {name} {value:.3f}; travel {low:g} … {high:g}")

    def _free(self, name: str, goal: float) -> None:
        """Raises InputError when the probe comes near anything on the table while the axis turns, whichever way it goes."""
        axis, machine = self._plan.machine.axis(name), self._plan.machine
        start = self.at[name] if name in self._known else None
        low, high = axis.travel or (-math.pi, math.pi)
        round_trip = high - low > math.radians(359) or axis.travel is None  # a control may go the other way round
        if start is None or round_trip:
            first, last = (goal - 180.0, goal + 180.0) if round_trip else (math.degrees(low), math.degrees(high))
        else:
            first, last = min(start, goal), max(start, goal)
        angles = np.linspace(first, last, 2 + int((last - first) / STEP))
        poses = np.tile([self.at[n] for n in machine.names], (len(angles), 1))
        poses[:, machine.column(name)] = angles
        gap = self._gap(poses)
        if gap < AIR:
            raise InputError(f"{name} turns with the probe {gap:.1f} mm from what is on the table; retract before turning")
        if self._beside:
            swept = turn(first, last)
            poses = np.tile([self.at[n] for n in machine.names], (len(swept), 1))
            poses[:, machine.column(name)] = swept
            known = {*self._known, name}
            if said := self._beside.met(self._radian(poses)[:, None], known, need=TURNING, begun=self._descended):
                raise InputError(f"while {name} turns before touch {self.touch.number}, {said}")

    def _keeps_off(self, target: Mapping[str, float], what: str) -> None:
        """Raises InputError when a straight motion from here comes near what is declared on the bodies of the machine."""
        if not self._beside:
            return
        places = np.array([list({**self.at, **end}.values()) for end in ({}, target)])
        if said := self._beside.met(self._radian(places)[None], self._known, need=STRAIGHT, begun=self._descended):
            raise InputError(f"on {what}, {said}")

    def _radian(self, poses: Array) -> Array:
        return poses * [1.0 if axis.kind == "linear" else math.pi / 180 for axis in self._plan.machine.axes]

    def _gap(self, poses: Array) -> float:
        """(n, k) mm deg → mm between probe and table, never more than there is: to an outermost plane or one across the tool."""
        probe = self._plan.machine.probe
        position = self._radian(poses)
        stem = max(probe.length - probe.body_length, 0.0)
        height = np.arange(0.0, probe.length + BEHIND, SPACING)
        radius = np.where(height <= stem, probe.stylus_radius, probe.body_radius)
        radius[height > probe.length] = max(probe.body_radius, probe.nose_radius)
        radius[0] = probe.tip_radius
        tip, spindle = kinematics.tip(self._chain, position), kinematics.spindle_axis(self._chain, position)
        points = tip[:, None, :] + height[None, :, None] * spindle[:, None, :]
        gap = math.inf
        for body in (*([self._solid.table] if self._solid.table else []), *self._solid.obstacles):
            outside = ((points @ body.normal.T - body.offset).max(axis=2) - radius).min(axis=1)
            # Over a pointed body no plane of its own says much: the one across the tool does.
            across = np.einsum("ij,ij->i", tip, spindle) - probe.tip_radius - (spindle @ body.corner.T).max(axis=1)
            gap = min(gap, float(np.maximum(outside, across).min()))
        for centre, size in zip(self._solid.centre, self._solid.radius, strict=True):
            gap = min(gap, float((np.linalg.norm(points - centre, axis=2) - size - radius).min()))
        return gap


def _anywhere(axis: Axis) -> float:
    """axis → a place within its travel that no plan goes to."""
    low, high = axis.travel or (-1.0, 1.0)
    return _unit(axis, low + 0.3718 * (high - low))


def _unit(axis: Axis, value: float) -> float:
    return value if axis.kind == "linear" else round(math.degrees(value), 9)


def _spelt(target: Mapping[str, float]) -> str:
    return " ".join(f"{name} {value:.3f}" for name, value in target.items())
