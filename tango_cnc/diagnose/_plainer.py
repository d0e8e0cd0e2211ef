"""What a shape follows, said with as little as does as well; and what else it may follow.

A pair of covariates often beats one of them by a little that is chance. An interaction is reported where there is strong evidence
for it beside the covariate alone; the others that come as near are told, because these touches cannot tell them apart. What a
name changes its size with is chosen among as many covariates, so the same holds for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..records import Array
from ._contest import Field, Picked, State, begin, price, scores, whiten

STRONG = 6.0  # evidence (Kass & Raftery 1995)
TOLD = 3  # other covariates that are told


def plainer(field: Field, y: Array, names: Array, picked: Sequence[Picked]) -> tuple[Picked, ...]:
    """field, data (m,), columns of the names (m, s), what was chosen → the same, each shape with fewer covariates where that does
    nearly as well, and with the covariates that it may follow instead.
    """
    found = list(picked)
    for i, p in enumerate(found):
        if p.kernel.kind != "shape":
            continue
        s = _beside(begin(field, y, names), [o for o in found if o is not p])
        best, at = scores(field, s)
        compared = [k.form is not None or (p.kernel.form is None and k.kind == "shape") for k in field.kernels]
        worth = np.where(compared, best[:, 0] - [price(field, len(y), k) for k in field.kernels], -np.inf)
        own = [j for j, k in enumerate(field.kernels) if k is p.kernel]
        if not own:
            continue
        least = worth[own[0]] - STRONG
        j = own[0]
        inside = [k for k in np.flatnonzero(worth > least) if _parts(field, int(k)) < _parts(field, j)]
        if inside:
            j = int(max(inside, key=lambda k: worth[k]))
            kernel = field.kernels[j]
            p = replace(p, kernel=kernel, columns=field.project(kernel), tau=float(at[j, 0]))
        mine = _parts(field, j)
        near = [int(k) for k in np.argsort(-worth) if worth[k] > max(worth[j] - STRONG, 0.0)]
        others = dict.fromkeys(
            field.kernels[k].covariate for k in (own[0], *near) if k == own[0] != j or not mine <= _parts(field, k)
        )
        found[i] = replace(p, rivals=tuple(others)[:TOLD])
    return tuple(found)


def _parts(field: Field, i: int) -> set[str]:
    kernel = field.kernels[i]
    if kernel.form is None:
        return set(kernel.covariate.split(" × "))
    return {f.covariate for f in kernel.form.factors}


def _beside(s: State, others: Sequence[Picked]) -> State:
    for p in others:
        s = whiten(s, p.kernel, p.columns, s.seen(p.columns), p.tau, p.score)
    return s


__all__ = ["plainer"]
