"""Where the table really stands: a few touches with long slow searches → the artefact, moved and turned as one piece.

Theory. The touches see the tip at the contact; the table is a rigid body, so every facet plane is moved by the same rotation R
and translation t (about the origin of the table frame). Each touch says that the plane is one tip radius from the tip centre:

    (R n) · (p_tip − R q − t) = r            n, q  normal and point of the facet as everybody thinks; six unknowns

Solved by least squares from no displacement; six touches on facets of different normals are enough, more show a wrong one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from . import kinematics
from .astray import AGREES, ASTRAY, EITHER, FILE, LEAST, LOOSER, MOST_GROWN, TURNED, agreeing, drawn, grown, no_proof, of_size
from .duration import duration
from .plan import displaced
from .plan import plan as planned
from .records import Approach, Array, Artefact, Cell, Facet, Indexation, InputError, Obstacle, Plan, Readings, Vector
from .telling import OtherSize, chosen, known_to, sure, to_edge, unsized, weakest, without_one

TOUCHES = 9
MOST = 11  # where several facets have an edge near, and the time allows
LONGEST = 180.0  # s of a cycle with more than TOUCHES, at PACE
PACE = 1500.0  # mm/min between touches: no dialect's usual positioning feed is less
PRICES = (0.0, *(1e-6 * 2.0**step for step in range(10)))  # of a mm of way, in what touches tell, while they take too long
FARTHEST = 20.0  # mm by which the table may stand elsewhere
LEAST_TURNED = 1.0  # deg, however near it is known to be
FEED = 600.0  # mm/min: a search of centimetres at a measuring feed takes minutes
CLEAR = 6.0  # mm that the stand-off keeps from a facet that is nearer than everybody thinks
LOOSEST = 1.0  # mm: beyond it nothing tells a wrong touch from a table whose file is wrong
STAYS = 0.5  # mm: an obstacle that has moved by less stands where it stood, for every clearance
KNOWN = 1.0  # mm: a facet that is not known better than this afterwards, no search of a few mm finds
NEAR = 5.0  # mm
NEARER = (
    "Measure the place of the table with a rule to 5 mm, correct it in artefact.yaml, then 'tango locate --within 5': its searches "
    "are shorter, and the stem of the stylus meets less"
)
FARTHER = (
    "It may stand farther away than these searches reach: measure its place with a rule again, correct it in artefact.yaml, or "
    f"search farther, 'tango locate --within {FARTHEST:g}'"
)


@dataclass(frozen=True)
class Located:
    """Where the table stands: `moved` (3,) mm and `turned` (3,) rad (rotation vector) in the table frame, and how well it fits."""

    moved: Array
    turned: Array
    residual: Array  # (n,) mm of every touch
    left_out: tuple[str, ...]  # facets beside which something else was met
    missed: tuple[str, ...]  # facets at which nothing was met
    counted: tuple[str, ...]  # facets whose touches the place rests on
    artefact: Artefact  # in its new place
    obstacles: tuple[str, ...]  # on the table, that the artefact has in both places: nobody has touched them


def turned(within: float) -> float:
    """mm by which the table may stand elsewhere → deg by which it may be turned."""
    return max(TURNED * within / FARTHEST, LEAST_TURNED)


def strategy(cell: Cell, count: int | None = None, within: float = FARTHEST) -> Plan:
    """cell, touches, mm by which the table may stand elsewhere → plan of the locating cycle.

    It touches facets of one indexation that together tell all six freedoms, searched from far. Without a count there are nine, or
    up to eleven where several may show the ball something else: eight that agree are left more often. Raises InputError where no
    indexation has facets that tell them.
    """
    found = _cycle(cell, count or TOUCHES, within)
    for more in range(TOUCHES + 1, MOST + 1 if count is None else 0):
        if len(beside(found, within)[0]) <= ASTRAY:
            break
        other = _cycle(cell, more, within)
        if len(other.touches) == more and sum(duration(other, PACE).values()) <= LONGEST:
            found = other
    return found


def _cycle(cell: Cell, count: int, within: float) -> Plan:
    """cell, touches, mm by which the table may stand elsewhere → plan of the locating cycle. Raises InputError as `strategy`."""
    off, reach = _off(cell.artefact, within), _reach(cell.artefact, within)
    approach = Approach(reach + CLEAR, reach, FEED)
    best: tuple[float, Indexation, tuple[str, ...]] | None = None
    short: list[str] = []
    for indexation in _indexations(cell):
        allowed, why = _reached(cell, indexation, approach)
        names = chosen(cell.artefact, allowed, count, off)
        if unsized(cell.artefact, names).beside > KNOWN:  # a table of another size would be taken for one that is turned
            by_size = chosen(cell.artefact, allowed, count, off, sized=True)
            names = min(names, by_size, key=lambda order: max(unsized(cell.artefact, order).beside, KNOWN))
        weight = without_one(sure(cell.artefact, names, off))
        away, facet = known_to(cell.artefact, names)
        if len(names) >= LEAST and away <= KNOWN:  # six touches always agree
            if best is None or weight > best[0] + 1e-9:
                best = weight, replace(indexation, facets=names), allowed
        else:
            at = (
                " ".join(f"{name} {math.degrees(value):g}" for name, value in sorted(indexation.position.items())) or "the only one"
            )
            weak = f"; with {', '.join(names)} facet {facet} would be known to {away:.1f} mm" if math.isfinite(away) else ""
            short.append(f"  indexation {at}: facets {', '.join(allowed) or 'none'}{weak}{why}")
    if best is None:
        raise InputError(
            f"{cell.artefact.name}: no indexation of {cell.strategy.name} has flat facets that determine where the table stands, "
            f"touched from {approach.standoff:.0f} mm away:\n" + "\n".join(short) + f"\nallowed: {LEAST} flat facets that face at "
            f"least three ways and stand far apart, so that all are known to {KNOWN:g} mm, at one indexation; add them to one of "
            f"strategy.yaml.{_round(cell.artefact)} Nothing was moved"
        )
    return _quick(cell, best[1], best[2], approach, within)


def _round(artefact: Artefact) -> str:
    """artefact → a sentence that says how many facets are not flat and so do not count; '' where all are flat."""
    count = sum(facet.surface is not None or facet.ball is not None for facet in artefact.facets.values())
    return (
        f" {count} of its {len(artefact.facets)} facets are on a cylinder or a ball: they tell no turn about their own axis and do "
        "not count. A table that has no flat sides is set up with a dial gauge."
        if count
        else ""
    )


def _quick(cell: Cell, indexation: Indexation, allowed: Sequence[str], approach: Approach, within: float) -> Plan:
    """cell, indexation with what tells most, its facets that can be touched, approach from far, mm → the plan of its touches.

    Their order is that of the shortest ways, each no higher than a table that stands elsewhere needs. As long as it takes more than
    `LONGEST`, a mm of way costs more of what the touches tell, and facets are exchanged for others.
    """
    off, names = _off(cell.artefact, within), indexation.facets
    whole = _made(cell, replace(indexation, facets=tuple(allowed)), approach)
    away = within + math.radians(turned(within)) * displaced.farthest(whole)
    ways = displaced.ways(displaced.raised(whole, off), away)
    for price in PRICES:
        names = _cheaper(cell.artefact, ways, names, off, price) if price else ways.shortest(names)
        made = _made(cell, replace(indexation, facets=names), approach)
        found = displaced.lowered(displaced.raised(made, off), away)
        if sum(duration(found, PACE).values()) <= LONGEST:
            break
    return found


def _cheaper(artefact: Artefact, ways: displaced.LocatingWays, names: Sequence[str], off: float, price: float) -> tuple[str, ...]:
    """facets that can be touched and the ways between them, those chosen, mm, what a mm of way costs → others, in their order.

    One is exchanged after the other as long as that helps, none for one that is nearer to an edge than it may be elsewhere.
    """

    edge = dict(zip(artefact.facets, to_edge(artefact, list(artefact.facets)), strict=True))  # mm, of every facet

    def room(order: Sequence[str]) -> Array:
        return np.array([edge[name] for name in order])

    def worth(order: Sequence[str]) -> float:
        return without_one(sure(artefact, order, off, room=room(order))) - price * ways.length(order)

    def allowed(order: Sequence[str]) -> bool:
        told = known_to(artefact, order)[0] <= KNOWN and (not sized or unsized(artefact, order).beside <= KNOWN)
        return told and int((room(order) < off).sum()) <= near

    sized = unsized(artefact, names).beside <= KNOWN
    near = int((room(names) < off).sum())
    order, better = ways.shortest(names), True
    least = worth(order) + 1e-9
    while better:
        better = False
        for out, other in product(tuple(order), ways.facets):
            if out not in order or other in order:
                continue
            tried = ways.inserted([name for name in order if name != out], other)
            if worth(tried) > least and allowed(tried):
                order, better = ways.shortest(tried), True
                least = worth(order) + 1e-9
    return order


def _made(cell: Cell, indexation: Indexation, approach: Approach) -> Plan:
    """cell, indexation, approach from far → the plan of its touches, its ways as for a table that stands where it should."""
    return planned(replace(cell, strategy=replace(cell.strategy, indexations=(indexation,), approach=approach)), "leave-out")


def _off(artefact: Artefact, within: float) -> float:
    """artefact, mm by which it may stand elsewhere → mm by which a facet may be elsewhere."""
    lever = max((math.hypot(*f.point) for f in artefact.facets.values()), default=0.0)
    return min(within + math.radians(turned(within)) * lever, 60.0)


def _reach(artefact: Artefact, within: float) -> float:
    """artefact, mm by which it may stand elsewhere → mm along its normal by which the plane of a facet may be elsewhere there."""
    turn, found = math.radians(turned(within)), [0.0]
    for facet in artefact.facets.values():
        arm = float(np.linalg.norm(np.cross(facet.point, facet.normal)))
        found.append((within + turn * arm + turn**2 / 2 * math.hypot(*facet.point)) / math.cos(turn))
    return min(max(found), 60.0)


def beside(plan: Plan, within: float = FARTHEST) -> tuple[tuple[str, ...], int]:
    """plan of the locating cycle, mm by which the table may stand elsewhere → facets with an edge nearer than they may be there;
    mm within which all but one have none.

    Beyond an edge a displaced table shows the ball something else, and what is left may not tell its place. 20 mm: as far as it
    searches; 0: not even a table that is known to 1 mm. The stem of the stylus may meet a wall earlier.
    """
    names = [touch.facet for touch in plan.touches]
    room, off = to_edge(plan.artefact, names), _off(plan.artefact, within)
    spared = min(max(len(names) - LEAST, 0), ASTRAY)
    least = float(np.sort(room)[spared])
    most = next((within for within in range(int(FARTHEST), 0, -1) if _off(plan.artefact, within) <= least), 0)
    return tuple(name for name, each in zip(names, room, strict=True) if each < off), most


def advice(plan: Plan) -> str:
    """plan of the locating cycle → what to do where it did not find the table: shorter searches, or longer ones."""
    short = plan.strategy.approach.search <= _reach(plan.artefact, NEAR) + 1e-6
    return FARTHER if short else NEARER


def _reached(cell: Cell, indexation: Indexation, approach: Approach) -> tuple[tuple[str, ...], str]:
    """cell, indexation, approach from far → its facets that a plan can touch so, and in words why not the others."""
    if not indexation.facets:
        return (), " that are flat"
    try:
        made = _made(cell, indexation, approach)
    except InputError as error:
        return (), f" ({error})"
    here = {touch.facet for touch in made.touches}
    why = f" ({'; '.join(made.left_out.values())})" if made.left_out else ""
    return tuple(name for name in indexation.facets if name in here), why


def locate(plan: Plan, readings: Readings, stated: float | None = None) -> Located:
    """plan of the locating cycle, its readings, mm to which somebody says that facets are in their places on the table → where the
    table stands.

    Raises InputError where they do not determine it. Where nobody has said how exact the file is, it is taken for right to
    `AGREES`, but its size for no better known than to 1 %.
    """
    agrees = stated or AGREES
    met = [row for row, status in enumerate(readings.status) if status in ("ok", "early")]
    facets = [plan.artefact.facets[readings.facet[row]] for row in met]
    if weakest(plan.artefact, tuple(facet.id for facet in facets)) < 1e-3:
        raise InputError(
            f"{len(met)} of {len(readings.status)} touches met something, and these do not tell where the table stands"
            f"{'; ' + _missed(readings) if _without(readings) else ''}. {advice(plan)}"
        )
    tip = kinematics.tip(kinematics.chain(plan.machine), readings.position[met])
    least = min(LEAST, len(plan.touches))
    if len(met) < least:
        raise InputError(
            f"{len(met)} of {len(readings.status)} touches met something; allowed: {least}, so that a wrong one is noticed; "
            f"{_missed(readings)}. {advice(plan)}"
        )
    if agrees > AGREES and len(met) < len(readings.status):  # one that met something else would agree to so much by chance
        raise InputError(
            f"--agrees: found {agrees:g}; allowed: {AGREES:g} where a touch met nothing.{_hidden(readings)}. See why "
            f"nothing was met there, then touch again. {advice(plan)}"
        )
    radius = plan.machine.probe.tip_radius
    kept, found, residual = agreeing(facets, tip, radius, least, agrees)
    if kept is not None and len(kept) < len(facets):
        (out,) = set(range(len(facets))) - set(kept)
        room = float(to_edge(plan.artefact, [facets[out].id])[0])
        if why := no_proof(facets, tip, radius, (out, found, residual), agrees, room, len(met) == len(readings.status)):
            raise InputError(
                f"facet {facets[out].id}: its touch is {residual[out]:+.2f} mm from where the others place the table. {why}"
            )
    if kept is None:
        worst = int(np.argmax(np.abs(residual)))
        off = f"facet {facets[worst].id}: its touch is {residual[worst]:+.2f} mm from where the others place the table; allowed: "
        if len(met) == len(readings.status) and (size := _grown(facets, tip, radius, agrees)):
            raise InputError(f"{off}{agrees:g} mm. {size}")
        raise InputError(
            f"{off}{agrees:g} mm. Was another facet touched, or something that is not the table? Is the probe "
            f"{plan.machine.probe.length:g} mm long, as machine.yaml has it? If so: {advice(plan)[0].lower()}{advice(plan)[1:]}."
            f"{_looser(facets, tip, radius, least, agrees) if len(met) == len(readings.status) else _hidden(readings)}"
        )
    left_out = tuple(facet.id for row, facet in enumerate(facets) if row not in kept)
    counted = tuple(facet.id for row, facet in enumerate(facets) if row in kept)
    if (turn := math.degrees(float(np.linalg.norm(found[3:])))) > TURNED:
        raise InputError(
            f"the touches fit a table that is turned by {turn:.5g} deg, and {TURNED:g} are searched. Is it that of artefact.yaml, "
            f"and of its size? Measure one of its widths. If it is, correct in artefact.yaml how it is turned, and touch again"
        )
    artefact = moved(plan.artefact, found[:3], found[3:])
    away = max(math.dist(artefact.facets[facet.id].point, facet.point) for facet in facets)
    if away > (most := 1.5 * plan.strategy.approach.search):
        raise InputError(
            f"the touches fit a table whose facets are {away:.0f} mm from where its file has them; allowed: {most:.0f} mm, as "
            "nothing farther was searched. Something else was touched, or the normals of the facets are wrong: look there first"
        )
    if (known := known_to(plan.artefact, counted, agrees))[0] > NEAR:
        raise InputError(
            f"facets that may be {agrees:g} mm beside their places on the table are known to {known[0]:.0f} mm then, the worst is "
            f"{known[1]}; allowed: {NEAR:g} mm, which a rule measures, too. Measure distances between the facets, correct them in "
            f"artefact.yaml, and read these same touches again with a smaller one: 'tango locate --readings {FILE} --agrees MM'"
        )
    if stated is None and (other := unsized(plan.artefact, counted)).beside > KNOWN:
        raise InputError(_of_no_size(plan, counted, other))
    solids, doubtful = _both_places(artefact.obstacles, found[:3], found[3:])
    missed, placed = _without(readings), replace(artefact, obstacles=solids)
    return Located(found[:3], found[3:], residual, left_out, missed, counted, placed, doubtful)


def _of_no_size(plan: Plan, counted: tuple[str, ...], other: OtherSize) -> str:
    """plan of the cycle, facets whose touches count, what another size may do unseen → why the table is not placed, and what to do.

    A touch that does not count may be the one that would tell: then it is made again, and nobody has to measure.
    """
    gone = tuple(touch.facet for touch in plan.touches if touch.facet not in counted)
    would = unsized(plan.artefact, (*counted, *gone)).beside <= KNOWN
    again = (
        f"Facet {', '.join(gone)} would tell, but nothing was met there, or something else: see what is in the way, then touch "
        "again. Or measure one width of the table."
        if would
        else "Measure one width of the table."
    )
    more = "" if would else ". Facets on the other half of each side would tell: add them to artefact.yaml and strategy.yaml"
    return (
        f"the touches agree, and yet {other.text}. These touches cannot tell. {again} Then 'tango locate --readings {FILE} "
        "--agrees MM' places the table from these same touches; nothing moves. MM is by how much your width differs from that of "
        f"artefact.yaml, {AGREES:g} at least{more}"
    )


def _without(readings: Readings) -> tuple[str, ...]:
    """readings of the cycle → facets at which nothing was met."""
    return tuple(name for name, status in zip(readings.facet, readings.status, strict=True) if status not in ("ok", "early"))


def _missed(readings: Readings) -> str:
    """readings of the cycle → the words for it: at which facets nothing was met."""
    return f"nothing was met at {', '.join(_without(readings))}"


def _hidden(readings: Readings) -> str:
    """readings of the cycle, in which a touch met nothing → why a table whose file is less exact is not offered."""
    return f" As {_missed(readings)}, too few touches are left to take the table for less exact than its file"


def _grown(facets: Sequence[Facet], tip: Array, radius: float, agrees: float) -> str:
    """as `agreeing` → the sentence on the table of another size that they fit; '' for none that anybody would take for this one."""
    by, left = grown(facets, tip, radius)
    if len(facets) < LEAST or left > agrees or not 1e-3 < abs(by) < MOST_GROWN:
        return ""
    if len(facets) > LEAST:
        return of_size(by)
    return EITHER.format(f"{of_size(by)}.")  # one touch alone speaks for seven unknowns


def _looser(facets: Sequence[Facet], tip: Array, radius: float, least: int, agrees: float) -> str:
    """as `agreeing` → what to do where the table is less exact than its file; '' where no `--agrees` places it.

    No number is handed out: that which these touches need would pass a table of another size as well.
    """
    steps = (step for step in np.round(np.arange(0.1, LOOSEST + 0.01, 0.1), 1) if step > agrees)

    def places(step: float) -> bool:
        kept = agreeing(facets, tip, radius, least, step)[0]
        return kept is not None and (len(kept) == len(facets) or drawn(facets, tip, radius, step) is None)

    if not any(places(float(step)) for step in steps):
        return ""
    return f" Only if you know that the facets are farther beside their places on the table: {LOOSER[0].lower()}{LOOSER[1:]}"


def moved(artefact: Artefact, by: Array, turn: Array) -> Artefact:
    """artefact, mm (3,), rotation vector rad (3,) → the same with its facets and balls there; obstacles stay, they are declared."""
    place, way = _moving(by, turn)

    def there(facet: Facet) -> Facet:
        surface = facet.surface
        if surface is not None and surface.axis is not None:
            surface = replace(surface, axis=way(surface.axis))
        return replace(facet, point=place(facet.point), normal=way(facet.normal), surface=surface)

    balls = {key: replace(ball, centre=place(ball.centre)) for key, ball in artefact.balls.items()}
    return replace(artefact, facets={key: there(facet) for key, facet in artefact.facets.items()}, balls=balls)


def _moving(by: Array, turn: Array) -> tuple[Callable[[Vector], Vector], Callable[[Vector], Vector]]:
    """mm (3,), rotation vector rad (3,) → what moves a point, what turns a direction."""
    rotation = Rotation.from_rotvec(turn)

    def place(point: Vector) -> Vector:
        x, y, z = (float(v) for v in rotation.apply(point) + by)
        return x, y, z

    def way(direction: Vector) -> Vector:
        i, j, k = (float(v) for v in rotation.apply(direction))
        return i, j, k

    return place, way


def _both_places(solids: Sequence[Obstacle], by: Array, turn: Array) -> tuple[tuple[Obstacle, ...], tuple[str, ...]]:
    """obstacles of the table, its way mm (3,) and turn rad (3,) → the same, each that would have moved with it by more than `STAYS`
    a second time, where it would be; the names of these.

    What is fixed to the table has moved with it, what was set up beside it has not, and no touch says which.
    """
    place, way = _moving(by, turn)
    found, names = list(solids), list[str]()
    for row, solid in enumerate(solids, 1):
        if solid.kind == "cylinder":
            assert solid.base is not None and solid.axis is not None
            x, y, z = (float(v) for v in np.array(solid.base) + (solid.height or 0.0) * np.array(solid.axis))
            ends: list[Vector] = [solid.base, (x, y, z)]
            there = replace(solid, base=place(solid.base), axis=way(solid.axis))
        else:
            sides = zip(solid.low or (), solid.high or (), strict=True)
            ends = list(solid.points or [(x, y, z) for x, y, z in product(*sides)])
            there = Obstacle("hull", points=tuple(place(end) for end in ends), title=solid.title, on=solid.on)
        if max(math.dist(place(end), end) for end in ends) > STAYS:
            names.append(solid.title or f"obstacle {row} ({solid.kind})")
            found.append(replace(there, title=f"{names[-1]}, moved with the table"))
    return tuple(found), tuple(names)


def _indexations(cell: Cell) -> Sequence[Indexation]:
    """→ the indexations of the strategy with every flat facet of the artefact, the least turned ones first."""
    flat = tuple(key for key, facet in cell.artefact.facets.items() if facet.surface is None and facet.ball is None)
    seen: dict[tuple[tuple[str, float], ...], Indexation] = {}
    for indexation in cell.strategy.indexations:
        seen.setdefault(tuple(sorted(indexation.position.items())), indexation)
    ordered = sorted(seen.values(), key=lambda i: sum(abs(v) for v in i.position.values()))
    return [replace(i, facets=tuple(f for f in _touched(cell, i) if f in flat)) for i in ordered[:4]]


def _touched(cell: Cell, indexation: Indexation) -> tuple[str, ...]:
    """→ facets that the strategy touches at this position."""
    same = (i.facets for i in cell.strategy.indexations if dict(i.position) == dict(indexation.position))
    return tuple(dict.fromkeys(name for names in same for name in names))
