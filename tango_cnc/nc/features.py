"""What a program's deviations mean for a part: distances, squareness, circularity, positions, each with an interval.

places:
  A: N120                          # where block N120 ends
  B: {X: 40, Y: 10, Z: -5, C: 90}  # programmed coordinates; axes that are not named are at 0
checks:
  - {name: pitch of the holes, kind: distance, of: [A, B]}
  - {name: B, kind: position, of: B, datum: [A, C, D]}    # x, y, z against the best fit of the datum's places; without: the zero
  - {name: sides, kind: squareness, of: [A, B, A, D]}     # line A B to line A D, over the length of the second one
  - {name: bore, kind: circularity, of: N95}              # the points of an arc: largest less smallest radius
point_um: 0.5     # standard uncertainty of one measured point of the part: of who measures it, and of cutting it
tool: {length_um: 2}  # its length was measured against the probe, with this standard uncertainty (`Tool`)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..compensate.fit import Known
from ..files.checked import Node, load, printable
from ..records import Array, InputError, Machine
from .correct import Machinery
from .follow import Motion, Setup, axes_beyond, positions
from .predict import drawn, levers, machinery, points_of

KINDS = ("distance", "position", "squareness", "circularity")
DRAWS = 2000
SUREST = (0.1, 100.0)  # µm, of a standard uncertainty of the tool
TURNED = 1e-6  # rad
PARALLEL = 1e-3  # rad between two lines, below which their angle is no linear function of their deviations


@dataclass(frozen=True)
class Check:
    """One feature that somebody will measure."""

    name: str
    kind: str
    of: tuple[str, ...]
    datum: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tool:
    """How the tool that cuts stands against the probe: its length was measured against the probe's, Z coming down to both.

    Places are cut with Z coming down, too. So whatever the touches cannot tell from the length of the probe, this tool has
    likewise. Its axis is that of the spindle; mm, standard uncertainties.
    """

    length: float
    eccentricity: float = 0.0  # of a tool that does not turn, in each direction


@dataclass(frozen=True)
class Wanted:
    """A list of checks with the places that they name."""

    places: Mapping[str, str | Mapping[str, float]]
    checks: tuple[Check, ...]
    point: float  # mm, standard uncertainty of a measured point
    tool: Tool | None = None  # None: nothing tells how the tool stands against the probe


@dataclass(frozen=True)
class Predicted:
    """A feature: µm against the program, its 95 % interval, whether it lies where nothing was touched, whether rotary axes turn
    between its places: then the errors of all axes sum up in it.
    """

    name: str
    kind: str
    value: float
    low: float
    high: float
    extrapolated: bool
    alone: float | None = None  # of a range whose value contains the scatter of its points: without it
    bounds: tuple[float, float] | None = None  # of a range: it is below the first with 5 %, above the second with 5 %
    turned: bool = False
    outside: tuple[str, ...] = ()  # what lies where nothing was touched, for people: axis, where it is, what was touched


def read(file: Path) -> Wanted:
    """YAML file → checks. Raises InputError for what is wrong, with file and line."""
    fields = load(file).fields(["checks"], ["places", "point_um", "tool"])
    places: dict[str, str | Mapping[str, float]] = {}
    for name, node in fields["places"].items() if "places" in fields else ():
        plain = node.plain()
        places[name] = str(plain) if not isinstance(plain, dict) else {axis: child.position() for axis, child in node.items()}
    checks = tuple(_check(node, places) for node in fields["checks"].list())
    if not checks:
        raise fields["checks"].wrong(
            "one check or more; write one, such as '- {kind: distance, of: [A, B]}'", "none: nothing is checked"
        )
    point = fields["point_um"].number(0, 1000) * 1e-3 if "point_um" in fields else 0.0
    return Wanted(places, checks, point, _tool(fields["tool"]) if "tool" in fields else None)


def _tool(node: Node) -> Tool:
    fields = node.fields(["length_um"], ["eccentricity_um"])
    least, most = SUREST
    length, eccentricity = fields["length_um"], fields.get("eccentricity_um")
    for one in filter(None, (length, eccentricity)):
        value = one.number()
        if not least <= value <= most and (value or one is length):
            raise one.wrong(f"{least:g} to {most:g} (µm); 0.002 mm is written 2, and no tool is measured better than {least:g} µm")
    return Tool(length.number() * 1e-3, eccentricity.number() * 1e-3 if eccentricity is not None else 0.0)


def stated(tool: Tool) -> str:
    """what is stated of the tool → one line for people."""
    text = f"stated: the length of the tool was measured against the probe, standard uncertainty {tool.length * 1e3:g} µm"
    text += f"; it does not turn, and is beside the spindle axis by {tool.eccentricity * 1e3:g} µm" if tool.eccentricity else ""
    return f"{text}; Z comes down to every place"


def cut(setup: Setup, tool: Tool | None) -> Setup:
    """set-up, what is stated of the tool → set-up as the places are cut: with Z coming down, where that is stated."""
    return setup if tool is None else replace(setup, came={**setup.came, "Z": -1.0})


def _check(node: Node, places: Mapping[str, object]) -> Check:
    fields = node.fields(["kind", "of"], ["name", "datum"])
    kind = fields["kind"].text(KINDS)
    plain = fields["of"].plain()
    of = tuple(str(item) for item in plain) if isinstance(plain, list) else (str(plain),)
    wanted = {"distance": 2, "squareness": 4, "position": 1, "circularity": 1}[kind]
    if len(of) != wanted:
        raise fields["of"].wrong(f"{wanted} of the places for {kind}", f"{len(of)}")
    datum = tuple(str(item.plain()) for item in fields["datum"].list()) if "datum" in fields else ()
    if datum and (kind != "position" or len(datum) < 3):
        raise fields["datum"].wrong("three or more places, for a position", f"{len(datum)} for {kind}")
    for name in (*(of if kind != "circularity" else ()), *datum):
        if name not in places:
            known = printable(", ".join(places), 300)
            raise fields["of"].wrong(f"places that are listed under 'places': {known}", printable(repr(name), 80))
    return Check(fields["name"].text() if "name" in fields else f"{kind} {' '.join(of)}", kind, of, datum)


def predict(
    wanted: Wanted,
    setup: Setup,
    known: Known,
    labels: Mapping[str, Sequence[Motion]],
    touched: Mapping[str, tuple[float, float]],
    length: float | None = None,
) -> list[Predicted]:
    """checks, set-up, what is known, motions by label, touched ranges → every feature. Raises InputError for unknown blocks.

    `length`: as a tool of that length would cut the same places, mm; None: with the tools that cut them.
    """
    result, setup = [], cut(setup, wanted.tool)
    for check in wanted.checks:
        mach, at = _placed(check, wanted, setup, known, labels, length)
        points, nominal, turned = _points(mach, at)
        outside = _outside(setup.machine, at, touched)
        own = np.random.default_rng(5).normal(scale=wanted.point, size=(DRAWS, *points.shape[1:])) if wanted.point else 0.0
        spread = points[1:] + own
        for name, measure in _measures(check):
            value = float(measure(nominal, points[:1])[0]) * 1e3
            draws = measure(nominal, spread) * 1e3
            low, least, middle, most, high = (float(v) for v in np.quantile(draws, [0.025, 0.05, 0.5, 0.95, 0.975]))
            bounds = (least, most) if check.kind == "circularity" else None
            alone = None
            if check.kind == "circularity" and wanted.point:  # a range is never less than that of the scatter alone
                value, alone = middle, value
            result.append(Predicted(name, check.kind, value, low, high, bool(outside), alone, bounds, turned, outside))
    return result


def weights(wanted: Wanted, setup: Setup, known: Known, labels: Mapping[str, Sequence[Motion]]) -> list[Array]:
    """checks, set-up, what is known, motions by label → (p,) mm that a unit of every coefficient changes each feature, in the order
    of `predict`; of a circularity, the point of the arc that is known worst.
    """
    result, setup = [], cut(setup, wanted.tool)
    for check in wanted.checks:
        mach, at = _placed(check, wanted, setup, known, labels)
        nominal, unit = mach.meant(at), np.moveaxis(levers(mach, at), 2, 0)
        if check.kind == "circularity":
            every = _rest(nominal, unit)
            worst = np.einsum("pn,pq,qn->n", every, known.covariance, every, optimize=True)
            result.append(every[:, int(worst.argmax())])
        else:
            result += [measure(nominal, unit) for _, measure in _measures(check)]
    return result


def lengths_of(wanted: Wanted, setup: Setup, labels: Mapping[str, Sequence[Motion]]) -> list[float]:
    """checks, set-up, motions by label → mm, length of the tool that cuts each feature, in the order of `predict`."""
    return [_tools(check, wanted, setup, labels)[0][1] for check in wanted.checks for _ in _measures(check)]


def _points(mach: Machinery, at: Array) -> tuple[Array, Array, bool]:
    """→ (m + 1, n, 3) mm deviations of its points, (n, 3) mm where they are meant, whether rotary axes turn between them."""
    machine = mach.machine
    rotary = [machine.column(name) for name in machine.rotary]
    turned = bool(np.any(np.ptp(at[:, rotary], axis=0) > TURNED))
    return drawn(mach, at, DRAWS), mach.meant(at), turned


def _outside(machine: Machine, at: Array, touched: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
    """→ of every axis that is where nothing was touched: how far it goes, and what was touched; mm and degrees of the machine."""
    result = []
    for name in (n for n, there in axes_beyond(machine, at, touched).items() if there.any()):
        unit, factor = ("mm", 1.0) if name in machine.linear else ("°", 180 / math.pi)
        own, (low, high) = at[:, machine.column(name)] * factor, (v * factor for v in touched[name])
        far = own.max() if own.max() - high > low - own.min() else own.min()
        result.append(f"{name} is at {far:.1f} {unit}, touched were {low:.1f} to {high:.1f} {unit}")
    return tuple(result)


def _placed(
    check: Check,
    wanted: Wanted,
    setup: Setup,
    known: Known,
    labels: Mapping[str, Sequence[Motion]],
    length: float | None = None,
) -> tuple[Machinery, Array]:
    """→ the machine with the tool of a check, axis positions (n, k) of its points; `length`: as `predict`."""
    places = _tools(check, wanted, setup, labels)
    own = places[0][1]
    used = own if length is None else length
    at = positions(setup, [p for p, _, _ in places], [added + used - own for _, _, added in places])
    return machinery(setup, known, used), at


def _tools(
    check: Check, wanted: Wanted, setup: Setup, labels: Mapping[str, Sequence[Motion]]
) -> list[tuple[dict[str, float], float, float]]:
    """→ of every point of a check: programmed coordinates, length of its tool, mm that the control adds to Z for it."""
    places: list[tuple[dict[str, float], float, float]] = []
    if check.kind == "circularity":
        motion = _motion(check.of[0], labels)
        if motion.block.arc is None:
            raise InputError(f"features: {check.name}: found block {check.of[0]}, which is no arc; allowed: an arc")
        points = points_of(motion)
        places = [(point, motion.length, motion.added) for point in points[:: max(1, len(points) // 72)]]
    else:
        for name in (*check.of, *check.datum):
            place = wanted.places[name]
            if isinstance(place, str):
                motion = _motion(place, labels)
                places.append((motion.end, motion.length, motion.added))
            else:
                places.append((dict(place), setup.length, setup.length))
    if len({length for _, length, _ in places}) > 1:
        raise InputError(f"features: {check.name}: found places cut with tools of several lengths; allowed: one tool a check")
    return places


def _motion(label: str, labels: Mapping[str, Sequence[Motion]]) -> Motion:
    found = labels.get(label, ())
    if len(found) != 1:
        some = ", ".join(list(labels)[:5])
        what = "no such block that moves" if not found else f"{len(found)} blocks of that number"
        raise InputError(f"features: found {label!r}, {what}; allowed: a block of the program, e.g. {some}")
    return found[0]


Measure = Callable[[Array, Array], Array]


def _measures(check: Check) -> list[tuple[str, Measure]]:
    if check.kind == "distance":
        return [(check.name, _distance)]
    if check.kind == "squareness":
        return [(check.name, _squareness)]
    if check.kind == "circularity":
        return [(check.name, _circularity)]

    def component(i: int) -> Measure:
        return lambda nominal, d: _position(nominal, d)[:, i]

    return [(f"{check.name} {'xyz'[i]}", component(i)) for i in range(3)]


def _distance(nominal: Array, d: Array) -> Array:
    """To first order, as the deviations are: a part that is set up turned is as long as it should be, however far it is turned."""
    way = nominal[1] - nominal[0]
    long = float(np.linalg.norm(way))
    moved = d[:, 1] - d[:, 0]
    return np.asarray(moved @ way / long if long > 0 else np.linalg.norm(moved, axis=1))


def _squareness(nominal: Array, d: Array) -> Array:
    """Deviation of the angle between two lines, over the length of the second: positive = the angle has grown (mm).

    To first order, but where the lines are parallel and the angle can only grow.
    """
    one, two = nominal[1] - nominal[0], nominal[3] - nominal[2]
    first, second = d[:, 1] - d[:, 0], d[:, 3] - d[:, 2]

    def angle(a: Array, b: Array) -> Array:
        cosine = np.sum(a * b, axis=-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
        return np.asarray(np.arccos(np.clip(cosine, -1, 1)))

    long, sine = float(np.linalg.norm(two)), float(np.sin(angle(one, two)))
    if sine < PARALLEL:
        return np.asarray((angle(one + first, two + second) - angle(one, two)) * long)
    u, v = one / np.linalg.norm(one), two / long
    across_one, across_two = (v - (v @ u) * u) / np.linalg.norm(one), (u - (u @ v) * v) / long
    return np.asarray(-(first @ across_one + second @ across_two) / sine * long)


def _position(nominal: Array, d: Array) -> Array:
    """→ (m, 3) mm of the first point, after the best rigid fit of the others to their nominal places, where there are any."""
    if len(nominal) == 1:
        return np.asarray(d[:, 0])
    centre = nominal[1:].mean(axis=0)

    def lever(points: Array) -> Array:
        return np.stack([np.hstack([np.eye(3), np.stack([np.cross(e, p - centre) for e in np.eye(3)], axis=1)]) for p in points])

    rigid = np.einsum("ij,mj->mi", np.linalg.pinv(lever(nominal[1:]).reshape(-1, 6), rcond=1e-9), d[:, 1:].reshape(len(d), -1))
    return np.asarray(d[:, 0] - np.einsum("ij,mj->mi", lever(nominal[:1])[0], rigid))


def _circularity(nominal: Array, d: Array) -> Array:
    return np.asarray(np.ptp(_rest(nominal, d), axis=1))


def _rest(nominal: Array, d: Array) -> Array:
    """(n, 3) points of a circle, (m, n, 3) their deviations, mm → (m, n) radial ones about the best circle."""
    centre = _circle(nominal)
    radial = (nominal - centre) / np.linalg.norm(nominal - centre, axis=1, keepdims=True)
    columns = np.column_stack([np.ones(len(nominal)), radial])
    change = np.einsum("mni,ni->mn", d, radial)
    best = np.einsum("in,mn->mi", np.linalg.pinv(columns, rcond=1e-9), change)
    return np.asarray(change - np.einsum("ni,mi->mn", columns, best))


def _circle(points: Array) -> Array:
    """(n, 3) points of a circle → its centre: where the planes between its points meet."""
    away = points - points[0]
    _, _, axes = np.linalg.svd(away - away.mean(axis=0))
    flat = away @ axes[:2].T
    centre = np.linalg.lstsq(2 * flat, np.sum(flat**2, axis=1), rcond=None)[0]
    return np.asarray(points[0] + centre @ axes[:2])
