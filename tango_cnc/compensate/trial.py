"""The sign trial: a change of some micrometres in one place, touches before and after, the sign decided by measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from .. import kinematics
from ..files.checked import suggestion
from ..records import Array, InputError, TangoError
from ..touches import Touches
from .proposal import Proposal
from .space import Held, Poses
from .targets import Request

SIZE = 0.010  # mm, or what an angle does at 300 mm
REACH = 300.0
ENOUGH, APART = 14, 3.0  # touches that tell a table that was moved; times their scatter, by which something else has moved
LEAST = 0.003  # mm that the best touch has to change by for a sign to be told


@dataclass(frozen=True)
class Sign:
    """What the touches say: `ratio` is 1 for the sign that was assumed, −1 for the other one, 0 for no effect."""

    ratio: float
    std: float
    word: str  # as assumed, turned round, not used, undecided
    touches: int


def chosen(proposal: Proposal, name: str) -> list[Held]:
    """proposal, place or table → its numbers. Raises InputError with the nearest names when there is none."""
    own = [h for h in proposal.held if name in (h.place, h.table)]
    if not own:
        known = sorted({h.table for h in proposal.held if h.at is not None} | {h.place for h in proposal.held if h.at is None})
        raise InputError(f"--sign-trial: found {name!r}; allowed: {', '.join(known)}.{suggestion(name, known)}")
    return own


def trial(proposal: Proposal, name: str, size: float = SIZE) -> tuple[Proposal, dict[str, float]]:
    """proposal, place or table → the present values with this one changed, and the change of every number that has one."""
    changes = {}
    for h in chosen(proposal, name):
        step = size if h.kind == "length" else size / REACH
        changes[h.place] = (
            h.number(h.value(proposal.present[h.place]) + h.sign * step / abs(h.factor) * 1.0) - proposal.present[h.place]
        )
        if h.kind == "length":
            changes[h.place] = round(size / h.increment) * h.increment
    numbers = {**proposal.present, **{place: proposal.present[place] + change for place, change in changes.items()}}
    return replace(proposal, numbers=numbers), changes


def expected(held: tuple[Held, ...], changes: Mapping[str, float], touches: Touches) -> Array:
    """what a target stores, changes of its numbers, touches → (n,) mm, change of every touch's gap when the sign is as assumed."""
    poses = Poses(touches)
    moved = np.zeros((len(touches), 3))
    for h in held:
        if h.place in changes:
            moved += h.lever(poses) * changes[h.place] * h.sign / h.factor
    return np.asarray(np.sum(moved * touches.normal, axis=1))


def best(held: tuple[Held, ...], changes: Mapping[str, float], touches: Touches) -> tuple[int, float]:
    """→ number of the touch that feels the change most, mm by which its reading is to change.

    Raises TangoError when no touch feels it.
    """
    change = expected(held, changes, touches)
    at = int(np.argmax(np.abs(change)))
    if abs(change[at]) < LEAST:
        raise TangoError(
            f"--sign-trial: no touch of this strategy changes by {LEAST * 1e3:g} µm (the most is {abs(change[at]) * 1e3:.1f} µm): "
            "choose another place, or readings of a strategy that turns this axis"
        )
    return int(touches.number[at]), float(change[at])


def flips(module: ModuleType, request: Request, places: Mapping[str, float]) -> list[str]:
    """target, its request, places of a trial → NAME=VALUE of the settings that turn the sign of these places round."""
    before = {h.place: h.sign for h in module.held(request) if h.place in places}
    found = []
    for name in (n for n in module.OPTIONS if n.startswith("sign")):
        value = -request.options[name]
        turned = module.held(replace(request, options={**request.options, name: value}))
        if any(before.get(h.place, h.sign) != h.sign for h in turned):
            found.append(f"{name}={value}")
    return found


def _beside(before: Touches, rows: Array, want: Array, got: Array, least: float) -> tuple[float, float]:
    """touches before, which of them, (n,) mm that each is to change by, does change by, mm of two touches → share of the change
    and its standard deviation, where the table stands and the tip of the stylus let free.
    """
    point, normal, spindle = before.point[rows], before.normal[rows], before.spindle_normal[rows]
    columns = np.column_stack([want, normal, np.cross(point, normal) / REACH, spindle, np.ones(len(rows))])
    u, s, vt = np.linalg.svd(columns, full_matrices=False)
    keep = s > 1e-9 * s[0]
    found = vt[keep].T @ ((u[:, keep].T @ got) / s[keep])
    left = got - columns @ found
    scatter = max(least, float(np.sqrt(left @ left / max(len(rows) - int(keep.sum()), 1))))
    return float(found[0]), scatter * float(np.sqrt(np.sum((vt[keep, 0] / s[keep]) ** 2)))


def judge(held: tuple[Held, ...], changes: Mapping[str, float], before: Touches, after: Touches) -> Sign:
    """what a target stores, changes, touches before and with the change → verdict. Raises InputError without common touches."""
    first = {int(number): i for i, number in enumerate(before.number)}
    pairs = [(first[int(number)], j) for j, number in enumerate(after.number) if int(number) in first]
    if not pairs:
        raise InputError("--after: found no touch that --readings has, too; allowed: readings of the same touches")
    rows, others = np.array(pairs).T
    want = expected(held, changes, before)[rows]
    tips = [kinematics.tip(t.chain, t.position)[i] for t, i in ((before, rows), (after, others))]
    got = np.sum((tips[1] - tips[0]) * before.normal[rows], axis=1)
    power = float(want @ want)
    if power < LEAST**2:
        return Sign(0.0, np.inf, "undecided", len(rows))
    ratio = float(want @ got) / power
    scatter = least = before.machine.probe.repeatability * 2**0.5
    if len(rows) > 3:
        scatter = max(scatter, float(np.std(got - ratio * want, ddof=1)))
    std = scatter / power**0.5
    if len(rows) >= ENOUGH and scatter > APART * least:  # the table was moved, or another stylus is in the spindle
        ratio, std = _beside(before, rows, want, got, least)
    for word, value in (("as assumed", 1.0), ("turned round", -1.0), ("not used", 0.0)):
        if abs(ratio - value) < max(3 * std, 0.15) and std < 0.2:
            return Sign(ratio, std, word, len(rows))
    return Sign(ratio, std, "undecided", len(rows))
