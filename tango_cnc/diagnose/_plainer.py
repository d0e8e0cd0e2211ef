"""What a shape follows, said with as little as does as well; and what else it may follow.

A pair of covariates often beats one of them by a little that is chance. An interaction is reported where there is strong evidence
for it beside the covariate alone; the others that come as near are named, as these touches cannot tell them apart. What a name
with a size that changes follows is one of these, too. Of as many covariates, those that are no history are named first: a plan that
goes to few places makes the path to them a function of the places, and a path has more variants to be the best by chance.
Few functions tell best what a weak shape follows; its size comes from more of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..records import Array
from ..terms._shape import LEGENDRE, SIDE, values, weights
from ..touches import Touches
from ._adapted import Adapting, frames
from ._alike import SAME
from ._catalogue import STRONG
from ._contest import SURE
from ._field import Field, Picked, State, begin, price, score, scores, whiten
from ._forms import CURVED
from ._smooth import Kernel

TOLD = 3  # other covariates that are named
LEVER = 0.75  # of the lever of a tilt that one place makes
FLAT = 1e-6  # component of a normal that has no side
AMONG = SURE - STRONG  # what it costs at least that functions were chosen among hundreds, where they have one covariate more
TURNS = 2  # of adapting each shape beside the others
BEFORE = ("way", "path", "since", "pause")


def plainer(field: Field, y: Array, names: Array, picked: Sequence[Picked]) -> tuple[Picked, ...]:
    """field, data (m,), columns of the names (m, s), what was chosen → the same, each shape with the functions that suit it best,
    with fewer covariates where that does nearly as well, and with the covariates that it may follow instead.

    What is not worth its price beside the others, now that their functions suit them, is a part of them and left out.
    """
    found, one_by_one = list(picked), Adapting(field)
    known: dict[tuple[int, ...], Picked | None] = {}
    kept: list[Picked] = []  # so that no id comes twice
    for turn in range(TURNS):
        before = len(found)
        for p in tuple(found):
            others = [o for o in found if o is not p]
            key = (id(p), *(id(o.kernel) for o in others))
            if key not in known:
                known[key] = _plainer(one_by_one, y, names, p, others)
                kept += [p, *others]
            told = known[key]
            if told is not None or sum(map(told_of, found)) > 1:
                found = [o for one in found for o in ([one] if one is not p else [] if told is None else [told])]
                if told is not None:
                    known[(id(told), *key[1:])] = told
        if turn == 0:
            found = _joined(one_by_one, y, names, found)
        if sum(map(told_of, found)) < 2 and len(found) == before:
            break
    return tuple(found)


def _joined(adapting: Adapting, y: Array, names: Array, found: Sequence[Picked]) -> list[Picked]:
    """what adapts shapes, data (m,), columns of the names (m, s), what was chosen → the same, with one shape in the place of two
    where it has as much evidence.

    The first shape that is chosen takes what it can follow of a pair that was not tried, or not in this frame; a second one then
    follows what that leaves. Neither of them comes nearer beside the other.
    """
    field, m = adapting.field, len(y)
    found = list(found)
    for p, q in combinations([p for p in found if told_of(p)], 2):
        if not any(o is p for o in found) or not any(o is q for o in found):
            continue
        s = beside(begin(field, y, names), [o for o in found if o is not p and o is not q])
        alone = [score(s.y, s.seen(one.columns))[0] - price(field, m, one.kernel) for one in (p, q)]
        there = beside(s, [p])
        both = alone[0] + score(there.y, there.seen(q.columns))[0] - price(field, m, q.kernel)
        larger = _parts((p if alone[0] >= alone[1] else q).kernel)
        best = scores(field, s)[0][:, 0]
        formed = [int(i) for i in np.argsort(-best) if field.kernels[int(i)].form is not None]
        near = adapting.near(s, best, formed, [p.kernel, q.kernel])
        if not near:
            continue
        # One with more covariates than the larger of the two follows anything a little better, as where it stands alone.
        worths = [a.score - a.choice - (AMONG if larger < _parts(a.kernel) else 0.0) for a in near]
        one, worth = near[int(np.argmax(worths))], max(worths) - price(field, m, near[0].kernel)
        if worth >= both:
            at = next(i for i, o in enumerate(found) if o is p)
            found[at] = Picked(one.kernel, field.project(one.kernel), one.tau, worth)
            found = [o for o in found if o is not q]
    return found


def told_of(p: Picked) -> bool:
    """what was chosen → whether people read which covariates this shape follows."""
    return p.kernel.form is not None or "like" in p.kernel.setting


def _plainer(adapting: Adapting, y: Array, names: Array, p: Picked, others: Sequence[Picked]) -> Picked | None:
    """what adapts shapes, data (m,), columns of the names (m, s), what was chosen, the others → as `plainer` tells it.

    None where it is not worth its price beside them.
    """
    field = adapting.field
    if not told_of(p):
        return p
    found = _compared(adapting, beside(begin(field, y, names), others), y, p)
    own, worth = _parts(p.kernel), np.array([one.worth for one in found])
    plain = worth.copy()
    # Functions that were adapted are chosen among hundreds: with one more covariate they follow anything a little better.
    worth -= [
        max(AMONG - one.choice, 0.0) if one.adapted and own < one.parts and _inside(one.kernel, own) else 0.0 for one in found
    ]
    every, parts = [one.kernel for one in found], [one.parts for one in found]
    order = [int(k) for k in np.argsort(-worth)]
    if worth[order[0]] < 0:
        return None
    # Beside the others, which were not all there when it was chosen; what was chosen then stays where it comes near.
    first = next(k for k in order if parts[k] == own or worth[k] <= worth[order[0]] - STRONG)
    first = first if worth[first] > worth[order[0]] - STRONG else order[0]
    less = [k for k in order if worth[k] > worth[first] - STRONG and _less(parts[k], parts[first])]
    j = min(less, key=lambda k: _much(parts[k])) if less else first  # the best of those that follow as little
    near = [
        k for k in order if worth[k] > max(worth[j] - STRONG, 0.0) and not (parts[j] <= parts[k] and _inside(every[k], parts[j]))
    ]
    wider = [every[first].covariate] if parts[j] < parts[first] else []  # the pair, where one of its two does as well
    wider += [p.kernel.covariate] if parts[j] < own else []
    wider += _more(every, parts, plain, j)
    rivals = _rivals([*_levered(every[j], parts[j], field), *wider, *(every[k].covariate for k in near)])
    if found[j].adapted:  # functions that were not adapted know their size better, unless they clearly cannot follow it
        j = next((k for k in order if not found[k].adapted and parts[k] == parts[j] and worth[k] > max(worth[j] - SURE, 0.0)), j)
    j = next((k for k in order if worth[k] > 0 and _richer(every[k], every[j])), j)
    if every[j] is not p.kernel:
        p = replace(p, kernel=every[j], columns=field.project(every[j]), tau=found[j].tau)
    return replace(p, rivals=rivals)


@dataclass(frozen=True)
class _Compared:
    """A shape: what it follows, its evidence less its price, its τ, and the price that was paid for adapted functions."""

    kernel: Kernel
    parts: set[str]
    worth: float
    tau: float
    choice: float = 0.0
    adapted: bool = False


def _compared(adapting: Adapting, s: State, y: Array, p: Picked) -> list[_Compared]:
    """what adapts shapes, state beside the others, data (m,), what was chosen → all that is compared with it, adapted ones last."""
    field = adapting.field
    best, at = scores(field, s)
    rows = [r for r, k in enumerate(field.kernels) if _parts(k) and (k.form is not None or p.kernel.form is None)]
    kernels = [field.kernels[r] for r in rows]
    found = [
        _Compared(k, _parts(k), best[r, 0] - price(field, len(y), k), float(at[r, 0])) for r, k in zip(rows, kernels, strict=True)
    ]
    down = np.argsort([-one.worth for one in found])
    formed = [rows[int(k)] for k in down if kernels[int(k)].form is not None]
    for a in adapting.near(s, best[:, 0], formed, [p.kernel]):
        worth = a.score - price(field, len(y), a.kernel) - a.choice
        found.append(_Compared(a.kernel, _parts(a.kernel), worth, a.tau, a.choice, True))
    return found


def _levered(kernel: Kernel, parts: set[str], field: Field) -> list[str]:
    """shape, what it follows → covariates that do the same on this plan through the lever of a place, or from the other side."""
    levers = _levers(kernel, field.means.whole) if len(parts) == 1 else []
    return [*(" × ".join((place, *parts)) for place in levers if place not in parts), *_against(kernel, field.means.whole)]


def _rivals(covariates: Sequence[str]) -> tuple[str, ...]:
    """covariates, the most important first → each once in any order of its two, as many as people read."""
    told = {frozenset(one.split(" × ")): one for one in reversed(covariates)}
    return tuple(reversed(told.values()))[:TOLD]


def _more(every: Sequence[Kernel], parts: Sequence[set[str]], worth: Array, j: int) -> list[str]:
    """shapes, what each follows, their evidence, number of the one that the answer names → covariates with one more that have more
    evidence than it, though not enough to take its place: the plainest of those that come near to the best.
    """
    more = [k for k in range(len(every)) if parts[j] < parts[k] and worth[k] > worth[j]]
    best = max((worth[k] for k in more), default=0.0)
    near = [k for k in more if worth[k] > best - STRONG]
    return [every[min(near, key=lambda k: (_much(parts[k]), -worth[k]))].covariate] if near else []


def _levers(kernel: Kernel, touches: Touches) -> list[str]:
    """shape or a name whose size changes, touches → linear axes whose place is the lever of the tilt that it is.

    A tilt that follows an angle shifts what is touched in proportion to a place, and so reads as a shift that follows both.
    """
    like = kernel.setting.get("name")  # None between two names
    name = "" if like is None else str(like.setting.get("name", ""))
    felt = kernel.form.weight if kernel.form is not None else f"tilt {name[1:2]} of {name[2:3]}"
    if not felt.startswith("tilt") or felt not in frames(touches):
        return []
    normal = touches.machine_normal

    def moved(columns: Array) -> Array:
        """What a shift of everything does not take."""
        return np.asarray(columns - normal @ np.linalg.lstsq(normal, columns, rcond=None)[0])

    lever = moved(weights(touches, felt)[:, 0])
    found = []
    for axis in touches.machine.linear:
        arms = moved(normal * touches.axis(axis)[:, None])
        part = (lever @ arms) ** 2 / np.maximum((lever @ lever) * np.sum(arms**2, axis=0), 1e-300)
        if part.max() > LEVER:
            found.append(axis)
    return found


def _against(kernel: Kernel, touches: Touches) -> list[str]:
    """shape, touches → the same with the direction of touch in the place of the side from which an axis came, where the touches
    that feel it came against their normals, as good as all of them: then these two are one thing.
    """
    if kernel.form is None:
        return []
    felt = np.sum(weights(touches, kernel.form.weight) ** 2, axis=1)
    known, found = values(touches), []
    for f in (f for f in kernel.form.factors if f.kind == SIDE and f.covariate.startswith("d")):
        for name in (name for name in known if name.startswith("normal")):
            against = touches.sign(f.covariate[1:]) * np.where(np.abs(known[name]) > FLAT, known[name], 0.0)
            if max(felt[against > 0].sum(), felt[against < 0].sum()) > SAME * felt.sum() > 0:
                parts = [name if o is f else o.covariate for o in kernel.form.factors]
                found.append(" × ".join(parts))
    return found[:1]


def _richer(one: Kernel, other: Kernel) -> bool:
    """two shapes → whether one is the other, a pair that bends, with more functions of both: these know their size better.

    Few functions tell best what a weak shape follows. What they cannot follow of it would be missing in the size and its std.
    """
    if one.form is None or other.form is None or one.form.weight != other.form.weight:
        return False
    a, b = one.form.factors, other.form.factors
    if len(b) != 2 or [(f.covariate, f.kind) for f in a] != [(f.covariate, f.kind) for f in b]:
        return False
    return all(f.count == CURVED and f.kind == LEGENDRE for f in b) and all(f.count > CURVED for f in a)


def _inside(kernel: Kernel, less: set[str]) -> bool:
    """shape, some of its covariates → whether it can do what one of these alone can, and more.

    What reverses with the side from which an axis came does not contain what does not.
    """
    return kernel.form is None or all(f.kind != SIDE or f.low == 0.0 or f.covariate in less for f in kernel.form.factors)


def _much(parts: set[str]) -> tuple[int, int]:
    """covariates → how many they are, and how many of them are what was before the touch."""
    return len(parts), sum(x.startswith(BEFORE) for x in parts)


def _less(parts: set[str], than: set[str]) -> bool:
    return bool(parts) and (parts < than or (len(parts) == len(than) and _much(parts) < _much(than)))


def _parts(kernel: Kernel) -> set[str]:
    """shape, or a name whose size changes → what it follows; nothing for noise and events."""
    if kernel.form is not None:
        return {f.covariate for f in kernel.form.factors}
    return set(kernel.covariate.split(" × ")) if "like" in kernel.setting else set()


def beside(s: State, others: Sequence[Picked]) -> State:
    """state, shapes and noises → the state with these in the covariance."""
    for p in others:
        s = whiten(s, p.kernel, p.columns, s.seen(p.columns), p.tau, p.score)
    return s


__all__ = ["plainer"]
