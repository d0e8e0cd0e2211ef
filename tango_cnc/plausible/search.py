"""Single mistakes tried one after the other: the one after which least is left, and most is plausible, comes first.

Two steps, so that the search takes seconds: every hypothesis that changes the cell or the readings is looked at without a fit;
the best of them, and those that give an unknown up or name touches, are fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import kinematics
from ..files.checked import Node, load
from ..judgement import Suspicion
from ..model import gap
from ..records import Array, Cell, InputError, Readings
from ..texts import say
from ..touches import FAR, Touches, from_readings
from .fit import BESIDE, Explained, Start, across, explain
from .mistakes import kinds
from .mistakes._case import Case, Hypothesis

FITTED = 28  # hypotheses of those without freed unknowns that are fitted
SAID = "the readings fit "  # how every hypothesis begins
ROUGH = 0.5  # mm: scale of the loss of the first look
SURE = 3.0  # by how much the logarithm of the likelihood has to grow before a mistake is suspected
EQUAL = 2.0  # difference of that below which two mistakes explain the readings equally well
NEAR = 4.0  # times the stated repeatability that touches may scatter and still fit: as much as leaves a result beyond doubt
TINY = 0.01  # of what was left before: with that a gross mistake is found, though the machine wanders, or has errors of its own
NEARER = 0.2  # of the way beside the facets that was there before, at most, for a mistake that leaves the gaps as they are
WORTH = 0.9  # of what was left before: who leaves more, and fits not, explains nothing
TOLD = 6  # suspicions that are handed back


@dataclass(frozen=True)
class _Tried:
    kind: str
    hypothesis: Hypothesis
    explained: Explained
    cost: float


def suspects(cell: Cell, readings: Readings) -> tuple[Suspicion, ...]:
    """cell, readings → mistakes that would explain the readings, most likely first; none where none is better than the cell."""
    used = readings.rows(readings.ok)
    if len(used) < 4:
        return ()
    start = Start(from_readings(cell.machine, cell.artefact, used))
    case = Case(cell, used, explain(cell.machine, cell.artefact, used, start=start))
    plain: list[tuple[float, str, Hypothesis]] = []
    freed: list[tuple[str, Hypothesis]] = []
    for kind, module in kinds().items():
        for h in module.hypotheses(case):
            if h.free or h.touches:
                freed.append((kind, h))
            else:
                cost = _first_look(_touches(case, start, h))
                plain.append((cost + h.price, kind, h))
    plain.sort(key=lambda item: item[0])
    tried = [_tried(case, start, kind, h) for kind, h in [*((k, h) for _, k, h in plain[:FITTED]), *freed]]
    better = [t for t in tried if t.cost < case.stated.cost - SURE and _less(t, case) and _is_one(t)]
    fitting = sorted((t for t in better if _fits(t, case)), key=lambda t: t.cost)
    part = sorted((t for t in better if not _fits(t, case) and t.explained.size < WORTH * case.stated.size), key=_size)
    good = [*fitting, *part]
    if not good:
        return ()
    floor = min(t.cost for t in good)
    near = [t for t in good if t.cost < floor + 0.5 * (case.stated.cost - floor)]
    return _told(cell, case, near)


def _touches(case: Case, start: Start, h: Hypothesis) -> Touches:
    """case, its start, hypothesis → the touches of its cell; which facets and balls they name is found once."""
    if h.machine is h.artefact is h.readings is None:
        return start.touches
    touches = from_readings(h.machine or case.machine, h.artefact or case.artefact, h.readings or case.readings)
    return touches.named_as(start.touches) if h.artefact is None and touches.facet == start.touches.facet else touches


def _first_look(touches: Touches) -> float:
    tip = kinematics.tip(touches.chain, touches.position)
    gaps, _ = gap(touches, tip, np.zeros(len(touches.facets)), np.zeros((len(touches.balls), 3)))
    beside = np.linalg.norm(across(tip - touches.point, touches.normal), axis=1)
    return float(np.log1p((gaps / ROUGH) ** 2).sum() + np.log1p((beside / BESIDE) ** 2).sum() / 2)


def _tried(case: Case, start: Start, kind: str, h: Hypothesis) -> _Tried:
    own = h.machine or case.machine, h.artefact or case.artefact, h.readings or case.readings
    touches = _touches(case, start, h)
    found = explain(*own, h.free, start=start if touches is start.touches else Start(touches))
    return _Tried(kind, h, found, found.cost + h.price)


def _less(tried: _Tried, case: Case) -> bool:
    """→ whether it leaves less of the gaps, or takes the touches to their places where the gaps say nothing of it."""
    return tried.explained.size < case.stated.size or (tried.explained.astray < NEARER * case.stated.astray and _fits(tried, case))


def _is_one(tried: _Tried) -> bool:
    """→ whether a freed unknown is large enough to be a mistake at all."""
    least = tried.hypothesis.least
    return not least or any(abs(tried.explained.values[name]) > size for name, size in least.items())


def _size(tried: _Tried) -> float:
    return tried.explained.size


def _fits(tried: _Tried, case: Case) -> bool:
    """→ whether what is left is near the stated scatter, or next to nothing of what was left before."""
    left, known = tried.explained, case.machine
    near = left.scatter <= NEAR * max(known.probe.repeatability, 1e-4)
    gross = left.scatter <= min(TINY * case.stated.size, known.tolerances.scatter)
    return (near or gross) and left.away <= FAR


def _told(cell: Cell, case: Case, tried: Sequence[_Tried]) -> tuple[Suspicion, ...]:
    found: list[Suspicion] = []
    groups: list[list[_Tried]] = []
    for t in tried:
        with_it = next(
            (g for g in groups if t.explained.cost - g[0].explained.cost < EQUAL and _alike(t.explained, g[0].explained)), None
        )
        if with_it is None:
            groups.append([t])
        else:
            with_it.append(t)
    for g in groups:  # what nothing in the readings can tell apart: the commonest first
        g.sort(key=lambda t: t.hypothesis.price)
    flat = [(t, g) for g in groups for t in g]
    for t, group in flat[:TOLD]:
        others = [o for o in flat if o[0] is not t]
        odds = (others[0][0].cost if others else case.stated.cost) - t.cost
        h = t.hypothesis
        text, change = h.words(t.explained.values) if h.words else (h.text, h.change)
        fits = _fits(t, case)
        if not fits:
            text = say("mistake.search.less_left", what=text.removeprefix(SAID))
        equally = tuple(_text(o) for o in group if o is not t) if t is group[0] else ()
        file, line = place(cell.folder, h.file, h.key)
        found.append(
            Suspicion(t.kind, text, file, h.key, change, line, h.touches, case.stated.size, t.explained.size, fits, odds, equally)
        )
    return tuple(found)


def less(suspicion: Suspicion) -> Suspicion:
    """suspicion → the same, of which it is not said that the readings fit."""
    if not suspicion.fits:
        return suspicion
    return replace(suspicion, text=say("mistake.search.less_left", what=suspicion.text.removeprefix(SAID)), fits=False)


def _text(tried: _Tried) -> str:
    h = tried.hypothesis
    return (h.words(tried.explained.values)[0] if h.words else h.text).removeprefix(SAID)


def _alike(one: Explained, other: Explained) -> bool:
    """→ whether two mistakes leave the same of every touch: nothing in the readings can tell them apart."""
    if len(one.gaps) != len(other.gaps):
        return False
    difference: Array = np.abs(one.gaps - other.gaps)
    return bool(np.median(difference) < 0.002)


def place(folder: Path, file: str, key: str) -> tuple[str, int | None]:
    """folder of a cell, what kind of file, key → its name and the line of the key, or of the nearest key above it."""
    if file == "readings":
        return "readings.csv", None
    name, node = f"{file}.yaml", None
    with suppress(InputError, KeyError):
        if file != "tango":
            name = dict(load(folder / "tango.yaml").items())[file].text()
        node = _down(load(folder / name), key.split("."))
    return name, None if node is None else node.line


def _down(node: Node, keys: Sequence[str]) -> Node:
    for key in keys:
        try:
            node = dict(node.items())[key]
        except (InputError, KeyError):
            break
    return node
