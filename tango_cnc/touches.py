"""Readings and artefact → the arrays that the model works on, one row a touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import kinematics
from .features import located
from .kinematics import Chain, Sensitivity, Slot
from .records import Array, Artefact, Id, Machine, Readings

ONE = math.radians(1)  # rad: a spindle that turns by no more stands still
FAR = 5.0  # mm from the nominal contact: no error of the machine, a facet of another name


class Curved(NamedTuple):
    """The touches of a plan on curved surfaces, one row each."""

    rows: NDArray[np.int64]  # (m,) which touches
    centre: Array  # (m, 3) mm, nominal centre or a point of the axis
    radius: Array  # (m,) mm
    axis: Array  # (m, 3) of a cylinder, zero otherwise
    side: Array  # (m,) 1 touched from outside, −1 from inside


@dataclass(frozen=True)
class Touches:
    """What is known of every touch before anything is estimated; lengths mm, angles rad, table frame unless said."""

    machine: Machine
    artefact: Artefact
    chain: Chain
    number: NDArray[np.int64]  # (n,)
    facet: tuple[Id, ...]
    position: Array  # (n, k)
    direction: Array  # (n, k)
    time: Array  # (n,) s
    feed: Array  # (n,) mm/min
    cycle: NDArray[np.int64]
    day: NDArray[np.int64]
    point: Array  # (n, 3)
    normal: Array  # (n, 3)
    temperatures: dict[str, Array]
    tip: Array | None = None  # (n, 3) mm, table frame: where a first estimate puts the stylus tip, beside its facet's nominal point
    stylus: NDArray[np.int64] | None = None  # (n,) number of the stylus, of `Machine.styli`; None: all with that of the probe
    count: NDArray[np.int64] | None = None  # (n,) as `counted`

    def __len__(self) -> int:
        return len(self.number)

    def rows(self, index: NDArray[np.int64]) -> Touches:
        """(k,) rows, in any order and as often as wanted → these touches alone."""
        return replace(
            self,
            number=self.number[index],
            facet=tuple(self.facet[i] for i in index),
            position=self.position[index],
            direction=self.direction[index],
            time=self.time[index],
            feed=self.feed[index],
            cycle=self.cycle[index],
            day=self.day[index],
            point=self.point[index],
            normal=self.normal[index],
            temperatures={k: v[index] for k, v in self.temperatures.items()},
            tip=None if self.tip is None else self.tip[index],
            stylus=None if self.stylus is None else self.stylus[index],
            count=_later(self.counted[index]),
        )

    @cached_property
    def counted(self) -> NDArray[np.int64]:
        """→ (n,) numbers of the touches in the readings, over all cycles and days; touches that were left out count, too.

        `at` and `until` of a cause mean these.
        """
        return np.arange(1, len(self) + 1) if self.count is None else self.count

    def row(self, at: float) -> int:
        """number of a touch, as `counted` → the row of the first touch from there on; the last one where all are before it."""
        return min(int(np.searchsorted(self.counted, int(at))), len(self) - 1)

    @cached_property
    def styli(self) -> tuple[int, ...]:
        """→ numbers of the other styli that touched, beside the one of the probe."""
        return () if self.stylus is None else tuple(int(s) for s in np.unique(self.stylus) if s != self.machine.stylus)

    def by_stylus(self, number: int) -> Array:
        """number of a stylus → (n,) 1 at its touches, 0 at those of others."""
        return np.full(len(self), float(number == self.machine.stylus)) if self.stylus is None else 1.0 * (self.stylus == number)

    @cached_property
    def radius(self) -> Array:
        """→ (n,) mm, stated radius of the tip that touched."""
        return of_stylus(self.machine, self.stylus, len(self), "tip_radius")

    @cached_property
    def facets(self) -> tuple[Id, ...]:
        """→ facets touched that are no part of a ball, in the artefact's order: each has an unknown offset."""
        touched = set(self.facet)
        return tuple(f.id for f in self.artefact.facets.values() if f.id in touched and f.ball is None)

    @cached_property
    def balls(self) -> tuple[Id, ...]:
        """→ balls touched, in the artefact's order: each has an unknown centre."""
        touched = {self.artefact.facets[f].ball for f in self.facet}
        return tuple(ball for ball in self.artefact.balls if ball in touched)

    @cached_property
    def facet_index(self) -> NDArray[np.int64]:
        """→ (n,) place of the touch's facet in `facets`, −1 on a ball."""
        place = {facet: i for i, facet in enumerate(self.facets)}
        return np.array([place.get(f, -1) for f in self.facet], dtype=np.int64)

    @cached_property
    def ball_index(self) -> NDArray[np.int64]:
        """→ (n,) place of the touch's ball in `balls`, −1 elsewhere."""
        place = {ball: i for i, ball in enumerate(self.balls)}
        own = [self.artefact.facets[f].ball for f in self.facet]
        return np.array([-1 if b is None else place[b] for b in own], dtype=np.int64)

    @cached_property
    def curved(self) -> Curved | None:
        """→ the touches on balls, cylinders and spheres, None when there are none."""
        rows: list[int] = []
        found: list[tuple[Array, float, Array, float]] = []
        for i, facet in enumerate(self.artefact.facets[f] for f in self.facet):
            if facet.ball is not None:
                ball = self.artefact.balls[facet.ball]
                found.append((np.array(ball.centre), ball.radius, np.zeros(3), 1.0))
            elif facet.surface is not None:
                surface = facet.surface
                side = -1.0 if surface.inside else 1.0
                centre = np.array(facet.point) - side * surface.radius * np.array(facet.normal)
                axis = np.zeros(3) if surface.axis is None else np.array(surface.axis)
                found.append((centre, surface.radius, axis, side))
            else:
                continue
            rows.append(i)
        if not rows:
            return None
        return Curved(np.array(rows), *(np.array(values) for values in zip(*found, strict=True)))

    @cached_property
    def indexation(self) -> NDArray[np.int64]:
        """→ (n,) number of the indexation, 0, 1, 2 …: a new one begins when a rotary axis or the spindle has turned."""
        columns = [self.machine.column(name) for name in (*self.machine.rotary, "S")]
        turned = (np.abs(np.diff(self.position[:, columns], axis=0)) > np.radians(0.05)).any(axis=1)
        changed = turned if self.stylus is None else turned | (np.diff(self.stylus) != 0)
        return np.concatenate([[0], np.cumsum(changed)]).astype(np.int64)

    @property
    def one_orientation(self) -> bool:
        """→ whether the spindle was never turned, so that the tip's place and the spindle's own are one."""
        return not np.ptp(self.axis("S")) > ONE

    def axis(self, name: str) -> Array:
        """letter → (n,) mm or rad, position of that axis."""
        return self.position[:, self.machine.column(name)]

    @cached_property
    def _powers(self) -> dict[tuple[str, int], Array]:
        return {}

    def power(self, name: str, degree: int) -> Array:
        """letter, degree → (n,) mm or rad to that power, of the position of that axis: six error motions share each."""
        key = name, degree
        if key not in self._powers:
            self._powers[key] = self.axis(name) ** degree if degree else np.ones(len(self))
        return self._powers[key]

    def sign(self, name: str) -> Array:
        """letter → (n,) −1 0 1, direction of that axis' last motion."""
        return self.direction[:, self.machine.column(name)]

    @cached_property
    def nominal(self) -> Touches:
        """→ the same touches where the nominal machine would make them on the nominal table.

        What a plan can see is decided there: at the real positions, 0.1 mm away, an exact dependence looks like a faint one.
        """
        tip = self.point + self.radius[:, None] * self.normal
        same = replace(self, position=kinematics.inverse(self.chain, self.position, tip)).named_as(self)
        same.__dict__["radius"] = self.radius
        return same

    def named_as(self, other: Touches) -> Touches:
        """touches of the same facets of the same artefact → these, which need not find out again what was touched."""
        for name in ("facets", "balls", "facet_index", "ball_index", "curved"):  # what the position has no part in
            self.__dict__[name] = getattr(other, name)
        return self

    @cached_property
    def seen(self) -> Sensitivity:
        """→ levers and normals of the nominal contacts: what a pattern is made of. A touch far from its facet keeps its place."""
        nominal = self.nominal.position
        columns = [self.machine.column(name) for name in self.machine.linear]
        far = np.abs(self.position - nominal)[:, columns].max(axis=1, initial=0.0) > FAR
        position = np.where(far[:, None], self.position, nominal)
        return kinematics.sensitivity(self.chain, kinematics.trace(self.chain, position), self.normal)

    @property
    def of_table(self) -> Array:
        """→ (n, 6) mm a unit (mm, rad): what a touch sees of the table moved along its X Y Z and turned about them."""
        return np.stack([self.seen.slots[Slot("w", "table", i)] for i in range(6)], axis=1)

    @property
    def machine_normal(self) -> Array:
        """→ (n, 3) outward normals in the machine frame."""
        return self.seen.machine_normal

    @property
    def spindle_normal(self) -> Array:
        """→ (n, 3) outward normals in the frame that turns with the spindle."""
        return self.seen.spindle_normal

    def lever(self, name: str) -> Array:
        """letter → (n,) mm/mm or mm/rad, change of the gap when that axis goes further than commanded."""
        return self.seen.slots[Slot(name, "motion")]

    @cached_property
    def warm(self) -> Array:
        """→ (n,) s since the machine was started on the touch's day; every day starts like the first."""
        first = {day: self.time[self.day == day].min() for day in np.unique(self.day)}
        begin = np.array([first[day] for day in self.day])
        return self.time - begin + (self.time.min() if len(self) else 0.0)


def from_readings(machine: Machine, artefact: Artefact, readings: Readings) -> Touches:
    """readings of which only the rows with status ok are used → touches."""
    rows = readings if readings.ok.all() else readings.rows(readings.ok)
    names = {name: number for number, name in enumerate(dict.fromkeys(rows.facet))}  # some sixty, touched hundreds of times
    facets, at = [artefact.facets[name] for name in names], np.array([names[f] for f in rows.facet], dtype=np.intp)
    return Touches(
        machine,
        artefact,
        kinematics.chain(machine, None if rows.stylus is None else of_stylus(machine, rows.stylus, len(rows), "length")),
        rows.touch,
        rows.facet,
        rows.position,
        rows.direction,
        rows.time,
        np.full(len(rows), np.nan) if rows.feed is None else rows.feed,
        rows.cycle,
        rows.day,
        np.array([f.point for f in facets]).reshape(-1, 3)[at],
        np.array([f.normal for f in facets]).reshape(-1, 3)[at],
        {name: values for name, values in rows.temperatures.items() if np.isfinite(values).all()},  # no value is made up
        stylus=rows.stylus,
        count=counted(readings)[readings.ok],
    )


def counted(readings: Readings) -> NDArray[np.int64]:
    """readings → (n,) number of every row, over all cycles and days: each of these has as many touches as the longest one."""
    number = np.asarray(readings.touch, dtype=np.int64)
    if len(number) and np.any(np.diff(number) <= 0):
        begins = (np.diff(readings.day) != 0) | (np.diff(readings.cycle) != 0)
        number = number + int(number.max()) * np.concatenate([[0], np.cumsum(begins)])
    return number if np.all(np.diff(number) > 0) else np.arange(1, len(number) + 1)


def _later(count: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) numbers of rows in any order → the same as far as they grow; what comes again is counted as touches made later."""
    again = np.flatnonzero(np.diff(count) <= 0)
    if not again.size:
        return count
    first = int(again[0]) + 1
    return np.concatenate([count[:first], count[:first].max() + np.arange(1, len(count) - first + 1)])


def of_stylus(machine: Machine, stylus: NDArray[np.int64] | None, count: int, what: str) -> Array:
    """machine, (n,) numbers of styli (None: that of the probe), n, field of `Probe` → (n,) its value at every touch."""
    if stylus is None:
        return np.full(count, float(getattr(machine.probe, what)))
    known = {s: float(getattr(machine.with_stylus(s).probe, what)) for s in np.unique(stylus).tolist()}
    return np.array([known[s] for s in stylus.tolist()])


class Misnamed(NamedTuple):
    """A touch that was not made at the facet that the readings name."""

    number: int
    facet: Id
    away: float  # mm from its nominal contact
    near: Id  # the facet whose nominal contact is nearest
    beside: float  # mm from that one
    row: int  # of the touch among those that were asked


def misnamed(touches: Touches) -> tuple[Misnamed, ...]:
    """touches → those further than `FAR` from the nominal contact of their facet, by the nominal machine."""
    tip = kinematics.tip(touches.chain, touches.position)
    away = np.linalg.norm(tip - touches.point - touches.radius[:, None] * touches.normal, axis=1)
    known = list(touches.artefact.facets.values())
    contacts = np.array([np.array(f.point) + touches.machine.probe.tip_radius * np.array(f.normal) for f in known])
    found = []
    for i in np.flatnonzero(away > FAR):
        distance = np.linalg.norm(contacts - tip[i], axis=1)
        nearest = int(np.argmin(distance))
        number = int(touches.number[i])
        found.append(Misnamed(number, touches.facet[i], float(away[i]), known[nearest].id, float(distance[nearest]), int(i)))
    return tuple(found)


def of_facets(
    machine: Machine,
    artefact: Artefact,
    facets: Sequence[Id],
    position: Array,
    direction: Array,
    stylus: NDArray[np.int64] | None = None,
) -> Touches:
    """facet ids (n), positions (n, k), directions of last motions (n, k), styli (n,) → touches that nobody has made yet."""
    n = len(facets)
    count, one = np.arange(n), np.ones(n, dtype=np.int64)
    planned = Readings(
        machine.names, count + 1, count.astype(float), tuple(facets), position, direction, ("ok",) * n, one, one, stylus=stylus
    )
    return from_readings(machine, located(artefact, facets), planned)
