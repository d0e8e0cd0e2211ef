"""One machine that carries out a program, and what may have gone wrong on the machines beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from .expressions import Value

LAG = 5.0  # mm between where an axis stands and where the probe is said to have been met
CHANGE = 0.008  # mm by which a work offset has changed
SOON = 0.05  # mm after its start at which the earliest contact happens
ZONE = 0.2  # mm before and behind the beginning of the search zone, where contacts are early and are none
RUN_ON = 0.01  # mm that the axes run on after a contact: where they stand is not where it was
ASIDE = 2.0  # mm beside the line of a measuring move: less is a contact, not another frame
AWAY = (0.05, -0.05, 180.0)  # deg by which a rotary axis has not arrived

Place = Mapping[str, float]


@dataclass
class Twin:
    """One machine that carries out the program."""

    fate: str  # "stop", or the flag that the record must carry
    what: str  # what has gone wrong
    position: dict[str, float]
    skip: dict[str, float]
    offset: dict[str, float]
    hit: bool = True
    shared: dict[int | str, Value] = field(default_factory=dict)
    local: list[dict[int | str, Value]] = field(default_factory=lambda: [{}])
    branch: bool = True  # whether statements are carried out, within IF … ENDIF
    stopped: bool = False
    unit: float = 1.0  # mm of what positions of X Y Z come in
    found: dict[str, float] | None = None  # where finding has met the facet, if that was early

    def met(self, place: Place, start: Place, target: Place) -> None:
        """{axis: mm}, beginning and end of a measuring move → the contact was there, and the axes have run on."""
        length = sum((target[n] - start[n]) ** 2 for n in target) ** 0.5
        self.skip, self.hit = self.position | dict(place), True
        self.position = self.skip | {n: place[n] + RUN_ON * (target[n] - start[n]) / length for n in target}

    def twin(self, fate: str, what: str) -> Twin:
        """→ the same machine at the same place in the program, of which something else becomes."""
        return Twin(
            fate,
            what,
            dict(self.position),
            dict(self.skip),
            dict(self.offset),
            self.hit,
            dict(self.shared),
            [dict(frame) for frame in self.local],
            self.branch,
            unit=self.unit,
        )

    def shown(self, name: str, value: float) -> float:
        """axis letter, mm or deg → as the control says it."""
        return value / self.unit if name in "XYZ" else value


def stopped_short(base: Twin, start: Place, target: Place, short: float, latches: bool) -> Iterator[Twin]:
    """machine after a protected move from start to target, mm → machines on which it ends `short` of it, by axis and on its line.

    `latches`: the control tells contact from none apart from where the axes stand, so either may be the only sign.
    """
    for name, goal in target.items():
        way = start[name] - goal
        if abs(way) > short:
            for hit in (True, False) if latches else (True,):
                twin = base.twin("stop", f"a protected move has been stopped short in {name}")
                twin.hit = hit
                twin.position[name] = twin.skip[name] = goal + max(min(way, short), -short)
                yield twin
    farthest = max(abs(start[name] - goal) for name, goal in target.items())
    for hit in (True, False) if latches and farthest > short else ():
        twin = base.twin("stop", "a protected move has been stopped short on its line")
        twin.hit = hit
        twin.position.update({name: goal + (start[name] - goal) * short / farthest for name, goal in target.items()})
        twin.skip.update({name: twin.position[name] for name in target})
        yield twin
    if latches:
        twin = base.twin("stop", "a protected move has met something at its very end")
        twin.hit = True
        yield twin


def other_contacts(base: Twin, start: Place, target: Place, zone: float, late: float) -> Iterator[Twin]:
    """machine after a measuring move, mm to its search zone, mm before its end → machines with a miss or another contact."""
    length = sum((target[n] - start[n]) ** 2 for n in target) ** 0.5

    def contact(flag: str, what: str, way: float) -> Twin:
        twin = base.twin(flag, what)
        twin.met({n: start[n] + (target[n] - start[n]) * way / length for n in target}, start, target)
        return twin

    miss = base.twin("0", "nothing was touched")
    miss.position.update(target)
    miss.skip, miss.hit = dict(miss.position), False
    yield miss
    yield contact("2", "the contact came at once", min(SOON, zone / 2))
    yield contact("2", "the contact came just before the search zone", zone - min(ZONE, zone / 4))
    yield contact("1", "the contact came at the beginning of the search zone", zone + ZONE)
    yield contact("1", "the contact came at the end of the search zone", length - late)


def offset_changed(base: Twin, start: Place, target: Place) -> Iterator[Twin]:
    """machine after a measuring move → machines whose work offset is another one now, axis by axis."""
    for name in target:
        for change in (CHANGE, -CHANGE):
            twin = base.twin("stop", f"the work offset of {name} has changed")
            twin.offset[name] += change
            yield twin


def turned_otherwise(base: Twin, name: str, dynamic: bool) -> Iterator[Twin]:
    """machine after a turn, axis letter, whether a work offset may turn → machines where it is elsewhere, or has done so."""
    for away in AWAY:
        twin = base.twin("stop", f"{name} has not arrived")
        twin.position[name] += away
        yield twin
    if dynamic:
        yield from offset_changed(base, {}, dict.fromkeys("XYZ", 0.0))


def latched_elsewhere(base: Twin, start: Place, target: Place) -> Iterator[Twin]:
    """machine after a measuring move → machines that say another position was latched, axis by axis."""
    for name in target:
        for lag in (LAG, -LAG):
            twin = base.twin("stop", f"the latched position of {name} has changed")
            twin.skip[name] += lag
            yield twin


def beside_the_line(base: Twin, start: Place, target: Place) -> Iterator[Twin]:
    """machine after a measuring move → machines whose result lies in another frame: in work coordinates, or beside the line."""
    length = sum((target[n] - start[n]) ** 2 for n in target) ** 0.5
    along = {n: (target[n] - start[n]) / length for n in target}
    work = base.twin("stop", "the result is in work coordinates")
    work.skip.update({n: base.skip[n] - base.offset[n] for n in target})
    yield work
    for name in target:
        aside = {n: LAG * (float(n == name) - along[name] * along[n]) for n in target}
        if sum(a**2 for a in aside.values()) ** 0.5 > ASIDE:
            twin = base.twin("stop", f"the result lies beside the line of its measuring move in {name}")
            twin.skip.update({n: base.skip[n] + a for n, a in aside.items()})
            yield twin
