"""A step of an axis that these touches cannot show: beyond one place of its travel an axis stands elsewhere, by a few µm.

The joint of a scale, a point of a compensation table. On a plan that touches few places of an axis, or each facet at one place,
facets and parameters take the step, and no residual is left. `tolerances.step` of machine.yaml says how large a step may be. It is
tried at every place between touches: where the touches would not show it, what it moves is not to be trusted, as with a drift.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..records import Array
from ..texts import joined, say
from .data import Remark
from .hidden_drift import MOVED, NAMED, SURE
from .lacking import NEAR_PLACE, Left, left_over, stretches

PART = 0.5  # of the parameters: no more are marked for a step that need not be there, those first that it moves most


def hidden_step(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → a note for each axis: a step of it moves parameters, and no touch shows the step."""
    if result.noise is None or (left := left_over(result)) is None:
        return
    machine, names, p = result.model.touches.machine, result.model.names, len(result.model.coefficients)
    size, labels = machine.tolerances.step, [result.selection.label(name) for name in names[:p]]
    found = {axis: _moved(result, left, axis, size) for axis in machine.linear}
    most = np.max([by.max(axis=0, initial=0.0) for _, by in found.values()], axis=0)
    taken = [int(j) for j in np.argsort(-most) if most[j] > MOVED]
    parameters = [j for j in taken if labels[j] in result.parameters]
    spared = parameters[int(PART * len(result.parameters)) :]
    for axis, (places, by) in found.items():
        moves = [j for j in taken if j not in spared and by[:, j].max(initial=0.0) > MOVED]
        if not moves:
            continue
        moves.sort(key=lambda j: -by[:, j].max())
        text = say(
            "plausible.hidden_step.found",
            axis=axis,
            size=f"{size * 1e3:g}",
            place=f"{places[int(np.argmax(by[:, moves[0]]))]:.0f}",
            names=joined(", ", [labels[j] for j in moves[:NAMED]]),
            moved=f"{by[:, moves].max():.0f}",
        )
        hidden = tuple((names[j], float(by[:, j].max() * left.std[j])) for j in moves)
        yield Remark("trustworthy", text, moves=tuple(names[j] for j in moves), hidden=hidden)


def _moved(result: Estimate, left: Left, axis: str, size: float) -> tuple[Array, Array]:
    """what the unknowns leave, axis, mm → (m,) places between touches at which a step of that size would not show, (m, p) standard
    deviations by which it moves every unknown there.
    """
    touches, p = result.model.touches, len(result.model.coefficients)
    place, lever = touches.axis(axis)[left.rows], touches.lever(axis)
    order = np.argsort(place, kind="stable")
    at = place[order]
    cut = np.flatnonzero(np.diff(at) > NEAR_PLACE) + 1
    tried = stretches(left, order, lever[:, None], cut, np.full(len(cut), len(at)))
    if tried is None:
        return np.empty(0), np.empty((0, p))
    seen, inside = (lever[left.rows] * left.weight)[order] ** 2, tried.inside[:, :, 0]
    rest = np.cumsum(seen[::-1])[::-1][tried.begin] - np.sum(inside**2, axis=1)
    hidden = rest * size**2 <= SURE**2
    begin = tried.begin[hidden]
    return (at[begin - 1] + at[begin]) / 2, np.abs(inside[hidden] @ left.back[:, :p]) * size / left.std[:p]
