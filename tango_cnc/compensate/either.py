"""With tool center point control or without: which of both answers the readings make likelier, by what the machine did in between.

Nearly every touch is as well explained by either answer: what the control's centers and directions take away is an error of the
machine in one of them. But in the wrong one the machine has changed by just these numbers since the run that they were made from,
and by what it did besides. Machines change by little, and now and then a lot in one or two places (a knock), not in every number of
a control at once. So each unknown changes as the nights take it, with tails that allow a knock (Cauchy's distribution; like the
horseshoe of Carvalho, Polson and Scott 2010, Biometrika 97, 465, it shrinks all but a few). Compared are both answers where each
is likeliest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..estimate import Estimate
from ..records import Array
from .fit import known
from .hidden import of_record, uncorrected
from .loop import Kept
from .outcome import poses_of
from .shares import LEAST_DAYS, Before, wander
from .space import Held, Poses

CERTAIN = float(np.log(1000.0))  # by how much an answer has to be likelier before it counts as proven, natural logarithm
STEPS = 60  # of a fit whose weights are found anew in each


def likelier(kept: Kept, first: Estimate, result: Estimate, held: Sequence[Held], *, tcp: bool, days: float = LEAST_DAYS) -> float:
    """compensation in the control, estimates of the run that it was made from and of one with it, what its target holds, the answer
    about tool center point control in the latter, days between → ln how much likelier that answer is than the other one.

    The machine that each run saw is its estimate and what the control took away in it.
    """
    machine = result.model.touches.machine
    at = poses_of(kept, machine)
    now, then = known(result, at), known(first, at)
    names = list(dict.fromkeys(c.name for c in (*now.coefficients, *then.coefficients)))
    levers = np.zeros((3 * len(at), len(names)))
    change, covariance = np.zeros(len(names)), np.zeros((len(names),) * 2)
    wanders = dict(zip(first.model.names, wander(Before(first, days)), strict=True))
    wanders |= dict(zip(result.model.names, wander(Before(result, days)), strict=True))
    for own, sign in ((then, -1.0), (now, 1.0)):
        rows = [names.index(c.name) for c in own.coefficients]
        levers[:, rows] = own.levers(at)
        change[rows] += sign * own.values
        covariance[np.ix_(rows, rows)] += own.covariance
    tables, centers, before = (_taken(sizes, held, at) for sizes in _numbers(kept, held))
    columns = at.free(np.column_stack([levers, tables, centers, before]))
    scale = np.maximum(np.linalg.norm(columns[:, : len(names)], axis=0), 1e-12)
    as_errors = np.linalg.lstsq(columns[:, : len(names)] / scale, columns[:, len(names) :], rcond=1e-9)[0] / scale[:, None]
    had = float(bool(kept.record.get("made_from", {}).get("tcp")))
    change = change + as_errors[:, 0] - had * as_errors[:, 2]
    spread = np.array([wanders[name] for name in names])
    unit = np.sqrt(np.diag(covariance) + spread**2)  # so that mm and rad weigh alike
    on, off = (
        unlikely((change + acts * as_errors[:, 1]) / unit, covariance / np.outer(unit, unit), spread / unit) for acts in (1.0, 0.0)
    )
    return off - on if tcp else on - off


def unlikely(change: Array, covariance: Array, spread: Array) -> float:
    """(p,) (p, p) change that is seen, its covariance, (p,) half widths of usual changes → −ln of the density of the
    likeliest true change, and of the scatter that it leaves.

    Weights of Cauchy's distribution are found by steps; each begins where all of what is seen is true, and where none is.
    """
    found = []
    for start in (change, np.zeros_like(change)):
        true = start
        for _ in range(STEPS):
            wide = (spread**2 + true**2) / 2
            pull = np.linalg.solve(covariance + np.diag(wide), change)
            true = wide * pull
        found.append(0.5 * float(pull @ covariance @ pull) + float(np.sum(np.log1p((true / spread) ** 2))))
    return min(found)


def _numbers(kept: Kept, held: Sequence[Held]) -> tuple[Array, Array, Array]:
    """compensation, what its target holds → (h,) each: what tables take away more than before it, what kinematics take away, and
    what these took away before it."""
    values = {v["place"]: v for v in kept.record["values"]}
    known_before = uncorrected(kept.record)
    new = of_record(kept.record)
    sizes = np.zeros((3, len(held)))
    for j, h in enumerate(held):
        if h.place not in values:
            continue
        is_now, was = (h.value(float(values[h.place][key])) for key in ("new", "present"))
        if h.tcp:
            plain = h.value(known_before.get(h.place, new.before([h])[h.place]))
            sizes[1:, j] = is_now - plain, was - plain
        else:
            sizes[0, j] = is_now - was
    return sizes[0], sizes[1], sizes[2]


def _taken(sizes: Array, held: Sequence[Held], at: Poses) -> Array:
    """(h,) mm rad mm/mm of each number, poses → (3n,) mm of tip error that they take away."""
    return sum((h.lever(at).ravel() * v for h, v in zip(held, sizes, strict=True) if v), np.zeros(3 * len(at)))
