"""Which columns of a Jacobian stand on their own, and which of them the noise of the probe would drown."""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from ..kinematics import Slot
from ..model import Model, known, with_levers
from ..records import Array, Combination, Machine
from ..terms import GAP, error_motion

# The faintest real coefficients of all example cells, to degree 6, keep 7e-4 of what they could amount to; dependent ones 1e-15, or
# 5e-7 where points are given to 1e-6 mm. At 2e-5 a touch of 0.7 µm would leave more than a millimetre undecided.
TOLERANCE = 2e-5
NOISE = 1e-11  # of the column itself: less is rounding
CLEAR = 1e-4  # of the column itself: as much is known to a part in a million from the normal equations, too
# mm at the longest lever: what would be known to no better than this is not seen. The model is curved; a standard deviation of
# half a millimetre on a machine of 300 mm already bends by as much as a touch scatters.
BLURRED = 0.5
FINEST = 1e-4  # mm: no touch is taken to be better than this


def columns(model: Model) -> tuple[Array, Array]:
    """model → Jacobian at its touches without errors (n + m, p), known distances included; what a column could amount to (p,).

    A shift could move every touch by itself, a turn by the longest lever, and of a power x³ only that part counts which
    x², x and a constant do not make as well. A column is faint by this measure, not by its own size: a round table does not
    see C turn, but for the rounding of its facets.
    """
    start = np.zeros(len(model.names))
    _, jacobian, levers = with_levers(model, start)
    _, rows, _ = known(model, start)
    touches = model.touches
    turns = [lever for slot, lever in levers.items() if slot != GAP and _turns(slot, touches.machine)]
    longest = float(np.max(np.abs(turns)))
    could = np.full(len(model.names), math.sqrt(len(touches)))
    size = _own_sizes(model)
    turning = np.array([_turns(slot, touches.machine) for slot in model.slots])[model.by_slot[3]]
    could[: len(model.coefficients)] = size * np.where(turning, longest, 1.0)
    return np.vstack([jacobian, rows]), np.where(could > 0, could, 1.0)


def _turns(slot: Slot, machine: Machine) -> bool:
    return slot.axis in machine.rotary if slot.stage == "motion" else slot.component >= 3


def _own_sizes(model: Model) -> Array:
    """→ (c,) length of what the lower powers of the same axis leave of a power; of any other regressor as it is.

    The triangle of 1, x, x² … has these lengths on its diagonal, for x brought to a range of 1.
    """
    size = np.linalg.norm(model.regressors, axis=1)
    powers: dict[str, list[tuple[int, int]]] = {}
    for j, c in enumerate(model.coefficients):
        if (match := error_motion.PATTERN.fullmatch(c.name)) is not None and match[3] != "0":
            powers.setdefault(match[2], []).append((j, int(match[3])))
    for axis, places in powers.items():
        x = model.touches.axis(axis)
        span = float(np.ptp(x))
        shape = np.vander((x - x.mean()) / (span or 1.0), max(power for _, power in places) + 1, increasing=True)
        triangle = linalg.lapack.dgeqrf(np.asfortranarray(shape), overwrite_a=True)[0]  # of a QR, and no more
        own = np.zeros(shape.shape[1])  # of more powers than touches nothing is left
        own[: len(x)] = np.abs(np.diag(triangle))
        for j, power in places:
            size[j] = own[power] * span**power
    return size


def independent(matrix: Array, could: Array, tolerance: float = TOLERANCE) -> tuple[list[int], dict[int, Array]]:
    """(m, p) columns in order of preference, (p,) their possible sizes → indices kept; for each left out, weights over those kept.

    Gram–Schmidt with one re-orthogonalisation (Giraud et al. 2005): unpivoted QR would let the rounding noise of a
    dependent column push out the columns behind it.
    """
    normal = matrix.T @ matrix
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale > 0, scale, 1.0)
    first = 0  # columns before it stand on their own by the diagonal of the triangle already
    if matrix.shape[0] > matrix.shape[1]:
        # The normal equations square what is ill-conditioned, and cost a fifth: far from the limit they are good enough.
        root, failed = linalg.lapack.dpotrf(normal / scale / scale[:, None])
        if not failed and np.all(np.diag(root) > np.maximum(CLEAR, 10 * tolerance * could / scale)):
            return list(range(matrix.shape[1])), {}
    reduced: Array = np.asfortranarray(matrix) / scale
    if matrix.shape[0] > matrix.shape[1]:
        reduced = np.triu(linalg.lapack.dgeqrf(reduced, lwork=64 * reduced.shape[1])[0][: reduced.shape[1]])
        size = np.abs(np.diag(reduced))
        first = int(np.argmin(np.append((size * scale > tolerance * could) & (size > NOISE), False)))
    count = reduced.shape[1]
    basis = np.zeros((count, reduced.shape[0]))
    triangle = np.zeros((count, count))
    basis[:first, :first] = np.eye(first)
    triangle[:first, :first] = reduced[:first, :first]
    kept: list[int] = list(range(first))
    left: dict[int, Array] = {}
    for j in range(first, count):
        column, k = reduced[:, j], len(kept)
        weights = basis[:k] @ column
        rest = column - weights @ basis[:k]
        again = basis[:k] @ rest
        rest -= again @ basis[:k]
        weights += again
        length = math.sqrt(rest @ rest)
        if length * scale[j] > tolerance * could[j] and length > NOISE:
            triangle[:k, k] = weights
            triangle[k, k] = length
            np.divide(rest, length, out=basis[k])
            kept.append(j)
        else:
            left[j] = linalg.solve_triangular(triangle[:k, :k], weights) * scale[j] / scale[kept] if k else np.empty(0)
    return kept, left


def condition_number(matrix: Array) -> float:
    """(m, p) → largest over smallest singular value; inf for fewer rows than columns and for a column of zeros.

    Powers of millimetres differ by more than double precision holds, so that singular values alone would end at 1e16: norm and
    norm of the inverse come from scaled columns.
    """
    scale = np.linalg.norm(matrix, axis=0)
    if matrix.shape[0] < matrix.shape[1] or not np.all(scale):
        return math.inf
    root = np.linalg.qr(matrix / scale, mode="r")
    inverse = linalg.solve_triangular(root, np.eye(len(scale))) / scale[:, None]
    return float(np.linalg.norm(root * scale, 2) * np.linalg.norm(inverse, 2))


def scaled_condition_number(matrix: Array) -> float:
    """(m, p) → the same with every column brought to length 1: it does not depend on mm, rad or powers."""
    if matrix.shape[0] < matrix.shape[1] or not np.all(np.linalg.norm(matrix, axis=0)):
        return math.inf
    size = np.linalg.svd(np.linalg.qr(matrix / np.linalg.norm(matrix, axis=0), mode="r"), compute_uv=False)
    return float(size[0] / size[-1])


def blurred(model: Model, matrix: Array, could: Array, wanted: set[str]) -> dict[str, Combination]:
    """model of independent columns, its `columns`, names that may be left out → those that such noise would not settle, in words.

    One by one, of all that moves together with the worst the highest power: what is left may then be seen well.
    """
    matrix = matrix.copy()
    sigma = max(model.touches.machine.probe.repeatability, FINEST)
    count = len(model.touches)
    matrix[count:] *= (sigma / known(model, np.zeros(len(model.names)))[2])[:, None]
    normal = matrix.T @ matrix
    scale = np.sqrt(np.diag(normal))
    reach = sigma * could / math.sqrt(count) / scale
    first, failed = linalg.lapack.dpotrf(normal / scale / scale[:, None])  # good enough far from the limit, as in `independent`
    if not failed and np.max(np.sqrt(np.diag(linalg.lapack.dpotri(first)[0])) * reach) < BLURRED / 2:
        return {}
    root = np.asarray(np.linalg.qr(matrix / scale, mode="r"))
    power = [int(m[3]) if (m := error_motion.PATTERN.fullmatch(name)) else 0 for name in model.names]
    left: dict[str, Combination] = {}
    stay = list(range(len(model.names)))
    while stay:
        if left:
            root = np.asarray(np.linalg.qr(root, mode="r"))
        inverse = np.triu(linalg.lapack.dtrtri(root)[0])
        amount = np.linalg.norm(inverse, axis=1) * reach[stay]
        bad = [i for i, j in enumerate(stay) if amount[i] > BLURRED and model.names[j] in wanted]
        if not bad:
            break
        blur = max(bad, key=lambda i: amount[i])
        with_it = np.abs(inverse @ inverse[blur])
        partners = [i for i, j in enumerate(stay) if with_it[i] > 0.01 * with_it[blur] and model.names[j] in wanted]
        worst = max(partners, key=lambda i: (power[stay[i]], with_it[i]))
        name = model.names[stay[worst]]
        blurs = "it" if blur == worst else model.names[stay[blur]]
        text = (
            f"{name} is too faint beside the others: touches that scatter by {sigma * 1e3:.2g} µm would leave "
            f"{amount[blur]:.2g} mm of {blurs} undecided"
        )
        left[name] = Combination((name,), (1.0,), text)
        root = np.delete(root, worst, axis=1)
        del stay[worst]
    return left
