"""A slow drift that these touches cannot show: where time and pose go together, the unknowns take it, and no residual is left.

How far a drift along an axis may go before the touches show it (three standard deviations of what the unknowns leave of it) and how
far it moves every parameter until then is linear algebra on the fit. A plan that comes back to its first touches shows it at once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..records import Array
from ..texts import joined, say
from .data import Remark
from .lacking import Left, left_over

USUAL = 5e-3  # mm that a workshop machine drifts by in such a run
LASTS = 300.0  # s: a shorter run is over before anything has drifted
SURE = 3.0  # standard deviations from which the touches show a drift
MOVED = 2.0  # standard deviations by which the drift moves a parameter that is not to be trusted then
TIMES = (0.3, 0.9, 30.0)  # of the run, in which a drift comes to rest; the last one is a straight line
NAMED = 6


def hidden_drift(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → a note on axes along which a usual drift shows in no touch, and moves parameters.

    Where the noise contains a drift, the standard deviations do as well: nothing is said.
    """
    if result.noise is None or result.noise.columns is not None or (left := left_over(result)) is None:
        return
    time = np.asarray(result.model.touches.time)[left.rows]
    if not len(time) or time[-1] - time[0] < LASTS:
        return
    share = (time - time[0]) / (time[-1] - time[0])
    shapes = [(1 - np.exp(-share / tau)) / (1 - np.exp(-1 / tau)) for tau in TIMES]
    p = len(result.model.coefficients)
    for i, axis in enumerate("XYZ"):
        normal = result.model.touches.machine_normal[left.rows, i]
        moved = np.max([_moved(left, normal * shape, p) for shape in shapes], axis=0)
        order = [int(j) for j in np.argsort(-moved) if moved[j] > MOVED]
        if not order:
            continue
        names = [result.selection.label(result.model.names[j]) for j in order[:NAMED]]
        words = {"axis": axis, "size": f"{USUAL * 1e3:g}", "names": joined(", ", names), "moved": f"{moved.max():.0f}"}
        moves = tuple(result.model.names[j] for j in order)
        hidden = tuple((result.model.names[j], float(moved[j] * left.std[j])) for j in order)
        yield Remark("trustworthy", say("plausible.hidden_drift.found", **words), moves=moves, hidden=hidden)


def _moved(left: Left, drift: Array, p: int) -> Array:
    """what the unknowns leave, (n,) what a drift of 1 mm does to the touches → (p,) standard deviations by which a usual one moves
    each unknown; nothing where it would show.
    """
    seen = drift * left.weight
    taken = left.basis.T @ seen
    rest = seen - left.basis @ taken
    if float(rest @ rest) * USUAL**2 > SURE**2:
        return np.zeros(p)
    return np.asarray(np.abs(left.back[:, :p].T @ taken) * USUAL / left.std[:p])
